//! Which part of a calibration the images contradict, from the estimate of all of it.

use nalgebra::{DMatrix, DVector};

/// Chooses the groups of an estimate that are not what was given: `error` is the estimate less what was given, with covariances after
/// and before the data; `groups` are rows that stand or fall together, `steps` the groups that may be freed at once. The most certain
/// first.
///
/// All models "these groups are free, the others as given" are compared by the Savage-Dickey density ratio (Dickey 1971),
/// `ln p(θ = given | data) − ln p(θ = given)` over the rows that are not free. Groups are freed step by step as long as the evidence
/// grows by `enough`, and fixed again where it does not need them any more.
pub(super) fn contradicted(
    error: &DVector<f64>,
    (posterior, prior): (&DMatrix<f64>, &DMatrix<f64>),
    (groups, steps): (&[Vec<usize>], &[Vec<usize>]),
    enough: f64,
) -> Vec<usize> {
    let evidence = |free: &[usize]| {
        let fixed: Vec<usize> =
            (0..groups.len()).filter(|k| !free.contains(k)).flat_map(|k| groups[k].iter().copied()).collect();
        let after = log_density(&error.select_rows(&fixed), &pick(posterior, &fixed))?;
        Some(after - log_density(&DVector::zeros(fixed.len()), &pick(prior, &fixed))?)
    };
    let mut free: Vec<usize> = Vec::new();
    let Some(mut now) = evidence(&free) else { return free };
    while free.len() < groups.len() {
        let with = |step: &Vec<usize>| {
            let mut more = free.clone();
            more.extend(step.iter().filter(|k| !free.contains(k)));
            (more.len() > free.len()).then(|| Some((evidence(&more)?, more)))?
        };
        let Some((best, more)) = steps.iter().filter_map(with).max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if best < now + enough {
            break;
        }
        (free, now) = (more, best);
    }
    let mut at = 0;
    while at < free.len() {
        let mut less = free.clone();
        less.remove(at);
        match evidence(&less) {
            Some(without) if without > now - enough => (free, now) = (less, without),
            _ => at += 1,
        }
    }
    free
}

/// What may be free of the chosen groups: all of them, all but one, one alone, and those of `pairs` that were chosen.
pub(super) fn choices(chosen: &[usize], pairs: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let with_least = |least: usize| if chosen.len() >= least { chosen } else { &[] };
    let all = with_least(1).first().map(|_| chosen.to_vec());
    let but_one = with_least(2).iter().map(|left_out| chosen.iter().copied().filter(|k| k != left_out).collect());
    let alone = with_least(3).iter().map(|k| vec![*k]);
    // Of three, a pair is all but one.
    let both = pairs.iter().filter(|pair| chosen.len() > 3 && pair.iter().all(|k| chosen.contains(k))).cloned();
    all.into_iter().chain(but_one).chain(alone).chain(both).collect()
}

/// An estimate as it would be if all groups but the free ones were known to be as given: `e_f − P_fx P_xx⁻¹ e_x`, and nothing elsewhere.
pub(super) fn conditioned(
    error: &DVector<f64>,
    posterior: &DMatrix<f64>,
    (groups, free): (&[Vec<usize>], &[usize]),
) -> Option<DVector<f64>> {
    let rows = |is_free: bool| -> Vec<usize> {
        (0..groups.len()).filter(|k| free.contains(k) == is_free).flat_map(|k| groups[k].iter().copied()).collect()
    };
    let (free, fixed) = (rows(true), rows(false));
    let mut conditioned = error.select_rows(&free);
    if !fixed.is_empty() {
        let factor = pick(posterior, &fixed).cholesky()?;
        let across = posterior.select_rows(&free).select_columns(&fixed);
        conditioned -= across * factor.solve(&error.select_rows(&fixed));
    }
    let mut all = DVector::zeros(error.len());
    free.iter().zip(&conditioned).for_each(|(row, value)| all[*row] = *value);
    Some(all)
}

fn pick(matrix: &DMatrix<f64>, rows: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(rows).select_columns(rows)
}

/// Logarithm of a normal density of mean zero, but for the powers of 2 π, which cancel.
fn log_density(x: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
    if x.is_empty() {
        return Some(0.0);
    }
    let factor = covariance.clone().cholesky()?;
    let half_log = factor.l_dirty().diagonal().map(f64::ln).sum();
    let value = -half_log - 0.5 * x.dot(&factor.solve(x));
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two unknowns that only their sum tells apart from a third: the sum is off, and one of them is blamed alone.
    #[test]
    fn the_fewest_groups_that_explain_it_are_named() {
        let prior = DMatrix::from_diagonal_element(3, 3, 1.0);
        // Measured: a + b with a variance of 1e-4, c with 1e-4.
        let h = DMatrix::from_row_slice(2, 3, &[1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let information = h.transpose() * &h * 1e4 + prior.clone().try_inverse().unwrap();
        let posterior = information.try_inverse().unwrap();
        let estimate = |sum: f64, c: f64| &posterior * h.transpose() * DVector::from_row_slice(&[sum, c]) * 1e4;
        let groups = [vec![0], vec![1], vec![2]];
        let steps = groups.clone();
        let found = |sum, c| contradicted(&estimate(sum, c), (&posterior, &prior), (&groups, &steps), 3.0);
        assert_eq!(found(0.0, 0.0), Vec::<usize>::new());
        assert_eq!(found(0.0, 0.5), [2]);
        assert_eq!(found(0.3, 0.0).len(), 1);
        assert!(found(0.3, 0.0)[0] < 2);
        assert_eq!(found(0.3, 0.5).len(), 2);
        // Two deviations are none.
        assert_eq!(found(0.0, 0.02), Vec::<usize>::new());
    }

    #[test]
    fn each_choice_is_made_once() {
        let pairs = [vec![0, 5], vec![1, 6]];
        let of = |chosen: &[usize]| choices(chosen, &pairs);
        assert_eq!(of(&[]), Vec::<Vec<usize>>::new());
        assert_eq!(of(&[5]), [[5]]);
        assert_eq!(of(&[5, 0]), [vec![5, 0], vec![0], vec![5]]);
        assert_eq!(of(&[5, 0, 3]), [vec![5, 0, 3], vec![0, 3], vec![5, 3], vec![5, 0], vec![5], vec![0], vec![3]]);
        let [all, but_one, alone] = [&[5, 0, 3, 1][..], &[0, 3, 1], &[5]];
        let of_four = of(all);
        assert_eq!([&of_four[0][..], &of_four[1], &of_four[5]], [all, but_one, alone]);
        assert_eq!(of_four[9..], [[0, 5]]);
    }

    /// Of two unknowns whose sum was measured the second is given: all of the sum is the first's.
    #[test]
    fn what_is_given_takes_no_share_of_an_error() {
        let information = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]) * 1e4 + DMatrix::identity(2, 2);
        let posterior = information.try_inverse().unwrap();
        let estimate: DVector<f64> = &posterior * DVector::from_row_slice(&[1.0, 1.0]) * 1e4 * 0.3;
        assert!((estimate[0] - 0.15).abs() < 1e-3 && (estimate[1] - 0.15).abs() < 1e-3);
        let found = conditioned(&estimate, &posterior, (&[vec![0], vec![1]], &[0])).unwrap();
        assert!((found[0] - 0.3).abs() < 1e-3 && found[1] == 0.0, "{found}");
        assert_eq!(conditioned(&estimate, &posterior, (&[vec![0], vec![1]], &[0, 1])).unwrap(), estimate);
    }
}
