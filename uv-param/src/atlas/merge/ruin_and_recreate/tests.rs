//! The search on surfaces whose answer is known.

use super::*;
use crate::atlas::cut::seam_cost::angle_deficits;
use crate::surface::Surface;

const BOUNDS: Bounds = Bounds { stretch: 1.15, worst: 1.5 };

/// `n` x `n` squares, each as two triangles; `at` places a vertex, and those at the same place are one.
fn surface(n: u32, at: impl Fn(f64, f64) -> [f64; 3]) -> Surface {
    let place = |i: u32| f64::from(i) / f64::from(n);
    let positions: Vec<_> = (0..(n + 1) * (n + 1)).map(|v| at(place(v % (n + 1)), place(v / (n + 1)))).collect();
    let corners =
        |x: u32, y: u32| [y * (n + 1) + x, y * (n + 1) + x + 1, (y + 1) * (n + 1) + x, (y + 1) * (n + 1) + x + 1];
    let squares = (0..n * n).map(|i| corners(i % n, i / n));
    let faces: Vec<_> = squares.flat_map(|[a, b, c, d]| [[a, b, d], [a, d, c]]).collect();
    Surface::new(&positions, &faces, true).unwrap().0
}

/// A torus, closed to the bit.
fn torus(n: u32) -> Surface {
    let turn = |x: f64| (std::f64::consts::TAU * x.rem_euclid(1.0)).sin_cos();
    surface(n, |x, y| {
        let ((s, c), (h, r)) = (turn(x), turn(y));
        [(1.0 + 0.4 * r) * c, (1.0 + 0.4 * r) * s, 0.4 * h]
    })
}

/// Charts of so many rows and columns of squares each.
fn in_blocks(surface: &Surface, n: usize, block: usize) -> Charts<'_> {
    let mut charts = Charts::new(surface, vec![false; 3 * surface.faces().len()]);
    let count = n.div_ceil(block);
    let mut lists = vec![Vec::new(); count * count];
    for f in 0..surface.faces().len() {
        let square = f / 2;
        lists[square / n / block * count + square % n / block].push(f as u32);
    }
    for faces in lists {
        add_region(&mut charts, faces, BOUNDS, None);
    }
    charts
}

fn tools<'a>(costs: &'a SeamCosts<'a>, deficits: &'a [f64]) -> SearchContext<'a> {
    SearchContext { costs, deficits, bounds: BOUNDS, parametrizer: None }
}

/// None of the seams that are there is ever tried, so that only patches can take them away.
#[test]
fn a_square_in_pieces_becomes_whole() {
    let flat = surface(12, |x, y| [x, y, 0.0]);
    let (costs, deficits) = (SeamCosts::new(&flat), angle_deficits(&flat));
    let mut charts = in_blocks(&flat, 12, 6);
    assert!((seam_cost_of(&charts, &costs) - 2.0).abs() < 1e-6);
    ruin_and_recreate(&mut charts, tools(&costs, &deficits), &HashSet::new(), &mut |_| ());
    assert_eq!(seam_cost_of(&charts, &costs), 0.0);
}

#[test]
fn seams_never_become_costlier_and_charts_keep_the_bounds() {
    let wave = |x: f64, y: f64| [x, y, 0.2 * (9.0 * x).sin() * (7.0 * y).cos()];
    for (surface, block) in [(torus(20), 5), (torus(20), 20), (surface(20, wave), 10), (surface(20, wave), 7)] {
        let (costs, deficits) = (SeamCosts::new(&surface), angle_deficits(&surface));
        let mut charts = in_blocks(&surface, 20, block);
        let mut before = cost_of(&charts, &costs);
        for _ in 0..2 {
            ruin_and_recreate(&mut charts, tools(&costs, &deficits), &HashSet::new(), &mut |_| ());
            let after = cost_of(&charts, &costs);
            assert!(after <= before, "{before} {after}");
            before = after;
        }
        let mut seen = vec![0; surface.faces().len()];
        for (name, faces) in charts.members.clone().into_iter().enumerate().filter(|(_, faces)| !faces.is_empty()) {
            let disk = charts.disk(&faces).unwrap();
            assert!(keeps(&disk, &charts.uv(&faces, &disk), BOUNDS));
            for &f in &faces {
                seen[f as usize] += 1;
                assert_eq!(charts.chart[f as usize], name as u32);
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }
}

#[test]
fn what_is_taken_back_leaves_every_bit() {
    let torus = torus(16);
    let (costs, deficits) = (SeamCosts::new(&torus), angle_deficits(&torus));
    let mut charts = in_blocks(&torus, 16, 8);
    ChartMerger::new(&mut charts, &costs, BOUNDS, None, &mut |_| ()).close_arcs();
    let bits = |charts: &Charts| {
        let uv: Vec<u64> = charts.corner_uv.iter().flatten().map(|x| x.to_bits()).collect();
        (charts.chart.clone(), charts.members.clone(), uv, charts.cut.clone())
    };
    let stays = HashSet::new();
    let mut changed = [false; 4];
    let mut random = Random(0);
    for _ in 0..8 {
        let (before, state) = (bits(&charts), State::of(&charts));
        let patch = draw_patch(&charts, &costs, &stays, &mut random).unwrap();
        let trial = Trial { tools: tools(&costs, &deficits), stays: &stays, cost: f64::INFINITY };
        trial.make(&mut charts, &patch, &mut |_| ());
        let now = bits(&charts);
        let differs = [now.0 != before.0, now.1 != before.1, now.2 != before.2, now.3 != before.3];
        changed = std::array::from_fn(|k| changed[k] || differs[k]);
        state.restore(&mut charts);
        assert!(bits(&charts) == before);
    }
    assert_eq!(changed, [true; 4]);
}
