//! Where a plan comes too near something it is made again with more clearance there, until it does so nowhere.

/// Targets on either side of one that comes too near that are kept farther off with it.
const NEIGHBOURS: usize = 2;

/// A target about which a plan comes too near something.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shortfall {
    /// Index of the target.
    pub(crate) target: usize,
    /// How much clearance is missing, m.
    pub(crate) missing: f64,
    /// More clearance would not help: the target is given up.
    pub(crate) hopeless: bool,
}

/// How clearances are raised.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Raise {
    /// More clearance than is missing, m: the next plan comes near elsewhere.
    pub(crate) beyond: f64,
    /// Clearance beyond which a target that still comes too near is given up, m.
    pub(crate) most: f64,
}

/// Makes an `attempt` with the clearance of each target, m, and again with more of it about the shortfalls that the attempt has found,
/// until it finds none. Attempts count from 0; a target that is given up has no clearance any more.
pub(crate) fn until_clear<P, E>(
    clearance: &mut [Option<f64>],
    raise: Raise,
    mut attempt: impl FnMut(&[Option<f64>], usize) -> Result<(P, Vec<Shortfall>), E>,
) -> Result<P, E> {
    let mut attempts = 0;
    loop {
        let (plan, shortfalls) = attempt(clearance, attempts)?;
        if shortfalls.is_empty() {
            return Ok(plan);
        }
        for Shortfall { target, missing, hopeless } in shortfalls {
            for near in target.saturating_sub(NEIGHBOURS)..(target + NEIGHBOURS + 1).min(clearance.len()) {
                let raised = clearance[near].map(|kept| kept + (missing + raise.beyond));
                clearance[near] = raised.filter(|raised| !hopeless && *raised <= raise.most);
            }
        }
        attempts += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_kept_farther_off_with_their_neighbours_and_given_up_in_the_end() {
        let mut clearance = [Some(0.03); 9];
        let raise = Raise { beyond: 0.01, most: 0.1 };
        // Target 1 asks for 6 cm, which is granted; target 6 for more than there is.
        let found = |clearance: &[Option<f64>], attempts: usize| {
            let mut shortfalls = Vec::new();
            if clearance[1].is_some_and(|kept| kept < 0.06) {
                shortfalls.push(Shortfall { target: 1, missing: 0.02, hopeless: false });
            }
            if clearance[6].is_some() {
                shortfalls.push(Shortfall { target: 6, missing: 0.05, hopeless: false });
            }
            Ok::<_, ()>((attempts, shortfalls))
        };
        assert_eq!(until_clear(&mut clearance, raise, found), Ok(2));
        let expected = [Some(0.06), Some(0.06), Some(0.06), Some(0.06), None, None, None, None, None];
        for (kept, expected) in clearance.iter().zip(expected) {
            assert_eq!(kept.is_some(), expected.is_some());
            assert!((kept.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1e-15, "{clearance:?}");
        }
        // What is hopeless is given up at once.
        let mut clearance = [Some(0.03); 3];
        let hopeless = |_: &[Option<f64>], attempts: usize| {
            let shortfall = Shortfall { target: 2, missing: 0.01, hopeless: true };
            Ok::<_, ()>((attempts, vec![shortfall; usize::from(attempts == 0)]))
        };
        assert_eq!(until_clear(&mut clearance, raise, hopeless), Ok(1));
        assert_eq!(clearance, [None; 3]);
    }
}
