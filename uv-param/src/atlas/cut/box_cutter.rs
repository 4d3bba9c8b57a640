//! Cuts for the page: charts fall into pieces that lie closer together. Every piece keeps its layout.
//!
//! A candidate is a chord across a part, between bays of its rim, that saves room around it (after Box Cutter, Limper et al. 2018); the seam runs
//! along the edges of the mesh near it. Of the candidates that save most for their length, the packer says which comes first.

mod chords;
mod part;
mod path;
mod pose;

use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::pack::{self, PackSettings, Page, Piece, Placement};
use crate::chart::Chart;
use crate::error::Error;
use crate::surface::{FaceLookup, Surface};
use chords::chords;
use part::{Part, Sheet};
use pose::Pose;

/// Smallest area of a piece, as a share of all.
const LEAST_AREA: f64 = 0.003;
/// Length that every seam costs besides its own, relative to the square root of the area: it makes another chart.
const EACH: f64 = 0.05;
/// Distance from its chord at which a seam becomes costly, relative to the same.
const WIDTH: f64 = 0.03;
/// Utilisation that a seam as long as that must gain.
const PRICE: f64 = 0.02;
/// Candidates of which the packer is asked before every cut.
const CANDIDATES: usize = 3;
/// Cuts, at most, and those in turn that bring nothing before it ends.
const MOST: usize = 40;
const PATIENCE: usize = 8;
/// How far below the target an estimate may be for the packer to be asked in earnest.
const SHORT: f64 = 0.03;
/// Estimates of which the packer is asked in earnest at the end.
const FINALISTS: usize = 3;

/// Charts with the faces of each, where they lie, and the pages.
pub(in crate::atlas) type Packed = (Vec<Chart>, Vec<Vec<u32>>, Vec<Placement>, Vec<Page>);

/// A part that could be two.
struct Split {
    pieces: [Part; 2],
    /// On the surface, metres.
    length: f64,
    /// Room saved for its length.
    value: f64,
}

/// Charts packed; cut before where [`PackSettings::utilisation`] asks for it. `turned`: whether pieces may be turned into their smallest boxes.
///
/// # Errors
/// As [`pack::pack`].
pub(in crate::atlas) fn cut_and_pack(
    surface: &Surface,
    charts: Vec<Chart>,
    members: Vec<Vec<u32>>,
    settings: &PackSettings,
    turned: bool,
) -> Result<Packed, Error> {
    let pieces: Vec<Piece> = charts.iter().map(|c| Piece::new(c.uv(), c.disk().faces())).collect();
    let (placements, pages) = pack::pack(&pieces, settings)?;
    let reached = pack::utilisation(&pieces, &pages, settings);
    if let Some(target) = settings.utilisation.filter(|&target| reached < target) {
        let mut cutter = Cutter::new(surface, &charts, &members, settings, turned);
        if let Some((parts, placements, pages)) = cutter.cut(target, reached) {
            let cut: Option<Vec<_>> = parts.iter().map(|part| cutter.chart(surface, &members, part)).collect();
            if let Some(cut) = cut {
                let (charts, members) = cut.into_iter().unzip();
                return Ok((charts, members, placements, pages));
            }
        }
    }
    Ok((charts, members, placements, pages))
}

struct Cutter<'a> {
    sheets: Vec<Sheet<'a>>,
    parts: Vec<Part>,
    /// The best cut of every part.
    splits: Vec<Option<Split>>,
    names: u32,
    settings: &'a PackSettings,
    turned: bool,
    /// Area of all charts, m^2.
    area: f64,
}

impl<'a> Cutter<'a> {
    fn new(
        surface: &Surface,
        charts: &'a [Chart],
        members: &[Vec<u32>],
        settings: &'a PackSettings,
        turned: bool,
    ) -> Self {
        let costs = SeamCosts::new(surface);
        let mut sheets: Vec<Sheet> =
            charts.iter().zip(members).map(|(c, faces)| Sheet::new(c, faces, &costs)).collect();
        let parts: Vec<Part> = sheets.iter_mut().enumerate().map(|(k, sheet)| sheet.whole(k, 0)).collect();
        let area = parts.iter().map(|part| part.area).sum();
        let mut cutter = Self { sheets, splits: Vec::new(), parts: Vec::new(), names: 1, settings, turned, area };
        for part in parts {
            let split = cutter.split(&part);
            cutter.parts.push(part);
            cutter.splits.push(split);
        }
        cutter
    }

    /// Cuts until the target is reached or nothing is gained any more; the parts, where they lie, and the pages. `None` where that is no better than
    /// without cuts, which reach `uncut`.
    fn cut(&mut self, target: f64, uncut: f64) -> Option<(Vec<Part>, Vec<Placement>, Vec<Page>)> {
        let scale = self.area.sqrt();
        // Parts, their utilisation less the cost of the seams, and that cost.
        let mut found: Vec<(Vec<Part>, f64, f64)> = Vec::new();
        let (mut best, mut since, mut paid) = (self.estimate(&self.parts).unwrap_or(0.0), 0, 0.0);
        while found.len() < MOST && since < PATIENCE {
            let mut order: Vec<usize> = (0..self.parts.len()).filter(|&k| self.splits[k].is_some()).collect();
            let value = |k: usize| self.splits[k].as_ref().map_or(0.0, |split| split.value);
            order.sort_by(|&a, &b| value(b).total_cmp(&value(a)).then(a.cmp(&b)));
            let tried = order.iter().take(CANDIDATES).filter_map(|&k| {
                let split = self.splits[k].as_ref()?;
                let cost = PRICE * split.length / scale;
                let share = self.estimate(&self.with(k, split))?;
                Some((share - cost, share, k))
            });
            let Some((_, share, k)) = tried.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
            let Some(split) = self.splits[k].take() else { break };
            paid += PRICE * split.length / scale;
            self.accept(k, split);
            found.push((self.parts.clone(), share - paid, paid));
            since = if share - paid > best { 0 } else { since + 1 };
            best = best.max(share - paid);
            if share > target - SHORT
                && let Some((share, placements, pages)) = self.packed(&self.parts)
                && share >= target
            {
                return Some((self.parts.clone(), placements, pages));
            }
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.truncate(FINALISTS);
        let mut winner = None;
        let mut least = uncut;
        for (parts, _, paid) in found {
            if let Some((share, placements, pages)) = self.packed(&parts)
                && share - paid > least
            {
                least = share - paid;
                winner = Some((parts, placements, pages));
            }
        }
        winner
    }

    /// All parts, with part `k` cut.
    fn with(&self, k: usize, split: &Split) -> Vec<Part> {
        let mut parts = self.parts.clone();
        let [one, other] = split.pieces.clone();
        parts[k] = one;
        parts.push(other);
        parts
    }

    fn accept(&mut self, k: usize, split: Split) {
        let [one, other] = split.pieces;
        for piece in [&one, &other] {
            self.sheets[piece.sheet].mark(&piece.faces, piece.name);
        }
        self.splits[k] = self.split(&one);
        let last = self.split(&other);
        self.splits.push(last);
        self.parts[k] = one;
        self.parts.push(other);
    }

    /// The cut of a part that saves most for its length.
    fn split(&mut self, part: &Part) -> Option<Split> {
        let (least, scale) = (LEAST_AREA * self.area, self.area.sqrt());
        if part.area < 2.0 * least {
            return None;
        }
        let sheet = &mut self.sheets[part.sheet];
        let mut found = chords(sheet, part, least);
        let value = |chord: &chords::Chord| chord.saved / (chord.length + EACH * scale);
        found.sort_by(|a, b| value(b).total_cmp(&value(a)));
        for chord in found {
            let Some(cut) = path::path(sheet, part, chord.ends, WIDTH * scale) else { continue };
            let Ok([one, other]) = <[Vec<u32>; 2]>::try_from(sheet.fall_apart(part, &cut)) else { continue };
            let pieces = [one, other].map(|faces| {
                self.names += 1;
                sheet.part_of(part.sheet, faces, self.names)
            });
            sheet.mark(&part.faces, part.name);
            if pieces.iter().all(|piece| piece.area >= least) {
                let length: f64 = cut.iter().map(|&h| sheet.chart().disk().edge(h as usize).norm()).sum();
                return Some(Split { pieces, length, value: chord.saved / (length + EACH * scale) });
            }
        }
        None
    }

    fn pose(&self, part: &Part) -> Pose {
        let points: Vec<[f64; 2]> = self.sheets[part.sheet].rim(part).iter().map(|edge| edge[0]).collect();
        Pose::of(&points, self.turned)
    }

    /// Whether nothing was cut off from a part yet.
    fn is_whole(&self, part: &Part) -> bool {
        self.sheets[part.sheet].chart().disk().faces().len() == part.faces.len()
    }

    fn pieces(&self, parts: &[Part]) -> Vec<Piece> {
        let piece = |part: &Part| {
            let mut rim = self.sheets[part.sheet].rim(part);
            if !self.is_whole(part) {
                let pose = self.pose(part);
                for edge in &mut rim {
                    *edge = edge.map(|at| pose.apply(at));
                }
            }
            Piece { rim }
        };
        parts.iter().map(piece).collect()
    }

    fn estimate(&self, parts: &[Part]) -> Option<f64> {
        pack::estimate(&self.pieces(parts), self.settings)
    }

    fn packed(&self, parts: &[Part]) -> Option<(f64, Vec<Placement>, Vec<Page>)> {
        let pieces = self.pieces(parts);
        let (placements, pages) = pack::pack(&pieces, self.settings).ok()?;
        Some((pack::utilisation(&pieces, &pages, self.settings), placements, pages))
    }

    /// A part as a chart of its own, and its faces on the surface.
    fn chart(&self, surface: &Surface, members: &[Vec<u32>], part: &Part) -> Option<(Chart, Vec<u32>)> {
        let (whole, names) = (self.sheets[part.sheet].chart(), &members[part.sheet]);
        if self.is_whole(part) {
            return Some((whole.clone(), names.clone()));
        }
        let faces: Vec<u32> = part.faces.iter().map(|&f| names[f as usize]).collect();
        let local = |h: usize| names.binary_search(&((h / 3) as u32)).map_or(h, |f| 3 * f + h % 3);
        let is_seam = |h: usize| whole.disk().twin(local(h)).is_none();
        let disk = surface.disk(&faces, is_seam, &mut FaceLookup::new(surface))?;
        let pose = self.pose(part);
        let mut uv = vec![[0.0; 2]; disk.positions().len()];
        for (corners, &f) in disk.faces().iter().zip(&part.faces) {
            for (&v, &w) in corners.iter().zip(&whole.disk().faces()[f as usize]) {
                uv[v as usize] = pose.apply(whole.uv()[w as usize]);
            }
        }
        Some((Chart::placed(disk, uv, pose.size, 0), faces))
    }
}
