//! Seams become shorter by ruin and recreate (Schrimpf et al. 2000): a patch around a seam is taken out of its charts and becomes one
//! of its own, seams are closed and straightened again around it, and what comes of it is kept if its seams are cheaper.

use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

use nalgebra::Vector3;

use super::add_region::add_region;
use super::fit::{Bounds, fit};
use super::layout::Charts;
use super::price::SeamPrices;
use super::refine::keeps;
use super::seams::{Arc, arcs};
use super::sew::Sewing;
use super::straighten::straighten_where;
use crate::disk::Disk;
use crate::parametrizer::{Parametrizer, Progress};
use crate::random::Random;

/// Faces that may be laid out by the search: so many times all, and at most.
const WORK: usize = 60;
const MAX_WORK: usize = 800_000;
/// Faces that one trial may lay out to close seams, times those of the charts that it takes apart.
const TRIAL_WORK: usize = 6;
/// Least work that a trial counts as, as a part of all faces: looking for seams takes time too.
const LEAST_WORK: usize = 100;
/// Area of a patch, as a share of the whole: least and most, drawn so that equal ratios are equally likely.
const PATCH: [f64; 2] = [0.004, 0.12];
/// Price after whole seams were closed, relative to that before, beyond which closing parts would not make up for it.
const HOPELESS: f64 = 1.03;
/// The same after parts were closed: beyond, straightening would not.
const TOO_DEAR: f64 = 1.02;
/// Smallest relative gain that counts.
const MIN_GAIN: f64 = 1e-6;

/// What is needed to close seams and to compare them.
#[derive(Clone, Copy)]
pub(super) struct Tools<'a> {
    pub(super) prices: &'a SeamPrices<'a>,
    /// [`angle_deficits`](super::price::angle_deficits).
    pub(super) deficits: &'a [f64],
    pub(super) bounds: Bounds,
    pub(super) parametrizer: Option<&'a dyn Parametrizer>,
}

/// Searches until its budget is spent; charts of `stays` are not touched.
pub(super) fn shorten(charts: &mut Charts, tools: Tools, stays: &HashSet<u32>, progress: &mut dyn FnMut(Progress)) {
    let faces = charts.surface.faces().len();
    let mut work = (WORK * faces).min(MAX_WORK);
    let mut random = Random(0);
    let mut price = seam_price(charts, tools.prices);
    while work > 0 {
        let Some(patch) = draw_patch(charts, tools.prices, stays, &mut random) else { break };
        let before = State::of(charts);
        let spent = Trial { tools, stays, price }.make(charts, &patch, progress);
        work = work.saturating_sub(spent.max(1 + faces / LEAST_WORK));
        let after = seam_price(charts, tools.prices);
        if after < price * (1.0 - MIN_GAIN) {
            price = after;
        } else {
            before.restore(charts);
        }
    }
}

/// One patch taken out, and everything around it closed again.
struct Trial<'a> {
    tools: Tools<'a>,
    stays: &'a HashSet<u32>,
    /// Price of all seams before.
    price: f64,
}

impl Trial<'_> {
    /// Returns the faces that were laid out.
    fn make(&self, charts: &mut Charts, patch: &[u32], progress: &mut dyn FnMut(Progress)) -> usize {
        let Tools { prices, deficits, bounds, parametrizer } = self.tools;
        // What could not be closed before is not tried again, nor straightened.
        let known: HashSet<(u32, u32)> = arcs(charts).iter().map(Arc::key).collect();
        let touched = ruin(charts, self.tools, patch);
        let limit = TRIAL_WORK * touched;
        let mut sewing = Sewing::new(charts, prices, bounds, parametrizer, progress);
        sewing.only = Some((self.stays.clone(), 0));
        sewing.work = limit;
        sewing.refuse(&known);
        sewing.close_arcs();
        // A patch is laid out twice at most: from its shadow, and from Tutte's embedding.
        let mut spent = 2 * patch.len() + limit - sewing.work;
        if seam_price(sewing.charts, prices) > HOPELESS * self.price {
            return spent;
        }
        let left = sewing.work;
        sewing.close_parts(deficits);
        spent += left - sewing.work;
        if seam_price(charts, prices) > TOO_DEAR * self.price {
            return spent;
        }
        let laid_out = Cell::new(0);
        let layout = |disk: &Disk, start| {
            laid_out.set(laid_out.get() + disk.faces.len());
            fit(disk, start, bounds, parametrizer)
        };
        let may_move =
            |arc: &Arc| !known.contains(&arc.key()) && ![arc.left, arc.right].iter().any(|c| self.stays.contains(c));
        straighten_where(charts, prices, &layout, may_move);
        spent + laid_out.get()
    }
}

/// Makes a patch a chart of its own. Returns the faces of the charts that it lay in.
fn ruin(charts: &mut Charts, tools: Tools, patch: &[u32]) -> usize {
    let surface = charts.surface;
    let inside: HashSet<u32> = patch.iter().copied().collect();
    let mut names: Vec<u32> = patch.iter().map(|&f| charts.chart[f as usize]).collect();
    names.sort_unstable();
    names.dedup();
    let mut touched = 0;
    let mut lost = Vec::new();
    for name in names {
        let faces = std::mem::take(&mut charts.members[name as usize]);
        touched += faces.len();
        let marked: Vec<bool> = faces.iter().map(|f| inside.contains(f)).collect();
        for (piece, is_inside) in charts.pieces(&faces, &marked) {
            if is_inside {
                continue;
            }
            let disk = charts.disk(&piece);
            match disk.map(|disk| (charts.uv(&piece, &disk), disk)) {
                Some((uv, disk)) if keeps(&disk, &uv, tools.bounds) => {
                    charts.add(piece, &disk, &uv);
                }
                _ => lost.push(piece),
            }
        }
        // Between two charts no edge counts as cut.
        for h in faces.iter().flat_map(|&f| 3 * f as usize..3 * f as usize + 3) {
            if let Some(twin) = surface.twin(h) {
                let [one, other] = [h, twin].map(|h| inside.contains(&((h / 3) as u32)));
                if one || other || charts.chart[h / 3] != charts.chart[twin / 3] {
                    (charts.cut[h], charts.cut[twin]) = (false, false);
                }
            }
        }
    }
    lost.push(patch.to_vec());
    for faces in lost {
        add_region(charts, faces, tools.bounds, tools.parametrizer);
    }
    touched
}

/// The faces nearest to a place on a seam; dear seams are more often drawn. `None` where there is no seam.
fn draw_patch(charts: &Charts, prices: &SeamPrices, stays: &HashSet<u32>, random: &mut Random) -> Option<Vec<u32>> {
    let surface = charts.surface;
    let seams: Vec<usize> = (0..3 * surface.faces().len())
        .filter(|&h| surface.twin(h).is_some() && charts.is_seam(h) && !charts.wanted[h])
        .collect();
    let total: f64 = seams.iter().map(|&h| prices.of(h as u32)).sum();
    let mut place = total * random.unit();
    let start = *seams.iter().find(|&&h| {
        place -= prices.of(h as u32);
        place <= 0.0
    })?;
    let [least, most] = PATCH;
    let area = surface.area() * least * (most / least).powf(random.unit());
    let centre = |f: usize| surface.corners(f).map(Vector3::from).iter().sum::<Vector3<f64>>() / 3.0;
    let mut best: HashMap<usize, f64> = HashMap::from([(start / 3, 0.0)]);
    let mut queue = BinaryHeap::from([Reverse((0_u64, start / 3))]);
    let (mut patch, mut covered) = (Vec::new(), 0.0);
    let mut done = HashSet::new();
    while let Some(Reverse((bits, f))) = queue.pop() {
        if !done.insert(f) {
            continue;
        }
        patch.push(f as u32);
        covered += surface.face_area(f);
        if covered > area {
            break;
        }
        for h in (3 * f..3 * f + 3).filter(|&h| !charts.wanted[h]) {
            let Some(twin) = surface.twin(h) else { continue };
            let other = twin / 3;
            if stays.contains(&charts.chart[other]) {
                continue;
            }
            let distance = f64::from_bits(bits) + (centre(other) - centre(f)).norm();
            if best.get(&other).is_none_or(|found| distance < *found) {
                best.insert(other, distance);
                queue.push(Reverse((distance.to_bits(), other)));
            }
        }
    }
    patch.sort_unstable();
    Some(patch)
}

/// Price of all seams.
fn seam_price(charts: &Charts, prices: &SeamPrices) -> f64 {
    let surface = charts.surface;
    let is_seam = |h: &usize| surface.twin(*h).is_some_and(|twin| *h < twin) && charts.is_seam(*h);
    (0..3 * surface.faces().len()).filter(is_seam).map(|h| prices.of(h as u32)).sum()
}

/// All that a trial changes.
struct State {
    chart: Vec<u32>,
    members: Vec<Vec<u32>>,
    corner_uv: Vec<[f64; 2]>,
    cut: Vec<bool>,
}

impl State {
    fn of(charts: &Charts) -> Self {
        Self {
            chart: charts.chart.clone(),
            members: charts.members.clone(),
            corner_uv: charts.corner_uv.clone(),
            cut: charts.cut.clone(),
        }
    }

    fn restore(self, charts: &mut Charts) {
        charts.chart = self.chart;
        charts.members = self.members;
        charts.corner_uv = self.corner_uv;
        charts.cut = self.cut;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::atlas::price::angle_deficits;
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

    fn tools<'a>(prices: &'a SeamPrices<'a>, deficits: &'a [f64]) -> Tools<'a> {
        Tools { prices, deficits, bounds: BOUNDS, parametrizer: None }
    }

    /// None of the seams that are there is ever tried, so that only patches can take them away.
    #[test]
    fn a_square_in_pieces_becomes_whole() {
        let flat = surface(12, |x, y| [x, y, 0.0]);
        let (prices, deficits) = (SeamPrices::new(&flat), angle_deficits(&flat));
        let mut charts = in_blocks(&flat, 12, 6);
        assert!((seam_price(&charts, &prices) - 2.0).abs() < 1e-6);
        shorten(&mut charts, tools(&prices, &deficits), &HashSet::new(), &mut |_| ());
        assert_eq!(seam_price(&charts, &prices), 0.0);
    }

    #[test]
    fn seams_never_become_dearer_and_charts_keep_the_bounds() {
        let wave = |x: f64, y: f64| [x, y, 0.2 * (9.0 * x).sin() * (7.0 * y).cos()];
        for (surface, block) in [(torus(20), 5), (torus(20), 20), (surface(20, wave), 10), (surface(20, wave), 7)] {
            let (prices, deficits) = (SeamPrices::new(&surface), angle_deficits(&surface));
            let mut charts = in_blocks(&surface, 20, block);
            let mut before = seam_price(&charts, &prices);
            for _ in 0..2 {
                shorten(&mut charts, tools(&prices, &deficits), &HashSet::new(), &mut |_| ());
                let after = seam_price(&charts, &prices);
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
        let (prices, deficits) = (SeamPrices::new(&torus), angle_deficits(&torus));
        let mut charts = in_blocks(&torus, 16, 8);
        Sewing::new(&mut charts, &prices, BOUNDS, None, &mut |_| ()).close_arcs();
        let bits = |charts: &Charts| {
            let uv: Vec<u64> = charts.corner_uv.iter().flatten().map(|x| x.to_bits()).collect();
            (charts.chart.clone(), charts.members.clone(), uv, charts.cut.clone())
        };
        let stays = HashSet::new();
        let mut changed = [false; 4];
        let mut random = Random(0);
        for _ in 0..8 {
            let (before, state) = (bits(&charts), State::of(&charts));
            let patch = draw_patch(&charts, &prices, &stays, &mut random).unwrap();
            let trial = Trial { tools: tools(&prices, &deficits), stays: &stays, price: f64::INFINITY };
            trial.make(&mut charts, &patch, &mut |_| ());
            let now = bits(&charts);
            let differs = [now.0 != before.0, now.1 != before.1, now.2 != before.2, now.3 != before.3];
            changed = std::array::from_fn(|k| changed[k] || differs[k]);
            state.restore(&mut charts);
            assert!(bits(&charts) == before);
        }
        assert_eq!(changed, [true; 4]);
    }
}
