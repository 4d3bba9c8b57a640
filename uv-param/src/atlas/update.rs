//! An atlas after its surface has changed in places: what was not touched stays, to the bit, so that what is painted there survives.

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::atlas::charts::Charts;
use crate::atlas::compute_charts::{Kept, by_number, finish, wanted_seams};
use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::merge::merge_charts::ChartMerger;
use crate::atlas::pack::{self, PackSettings, Page, PageSlot, Piece, Placement};
use crate::atlas::parametrize::add_region::add_region;
use crate::atlas::parametrize::fit::{Bounds, fit};
use crate::atlas::parametrize::procrustes::procrustes;
use crate::atlas::parametrize::refine::keeps;
use crate::atlas::parametrize::untangle::untangle;
use crate::atlas::{Atlas, AtlasSettings, unwrap_atlas};
use crate::disk::Disk;
use crate::error::Error;
use crate::parametrizer::Progress;
use crate::surface::Surface;

/// Sweeps that spread the places of old vertices over new ones: a start for the layout, no more.
const SWEEPS: usize = 200;

/// Share of a chart's faces that are new from which on the whole chart is laid out again if need be: for fewer, the time that takes and the texels
/// that move are out of proportion.
const REFITTED: f64 = 0.25;

/// What of an atlas is needed to keep it when its surface changes: which triangle lies where.
#[derive(Debug, Clone, PartialEq)]
pub struct AtlasLayout {
    /// Corners of every face, metres.
    pub corners: Vec<[[f64; 3]; 3]>,
    /// Chart of every face.
    pub chart: Vec<u32>,
    /// The corners in the plane of the chart, metres.
    pub corner_uv: Vec<[[f64; 2]; 3]>,
    /// Width and height of every chart, metres.
    pub sizes: Vec<[f64; 2]>,
    /// Where every chart lies.
    pub placements: Vec<Placement>,
    /// Columns and rows of the pages.
    pub pages: Vec<Page>,
    /// Side of a texel, metres.
    pub texel_m: f64,
}

/// What became of the charts of an atlas. A chart that is kept has the same number among those that are kept or changed, and these come first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AtlasUpdate {
    /// Faces that were there before.
    pub kept_faces: usize,
    /// Charts that are the same to the bit, on the same place.
    pub kept_charts: usize,
    /// Charts that lost or won faces: they were laid out again with what came instead, and lie where they were if they still fit there, or they are
    /// where they were, with a hole.
    pub changed_charts: usize,
    /// Charts that were not there before.
    pub new_charts: usize,
    /// Columns of texels that were added to the first page; what lies left of them stays at its texels.
    pub added_columns: usize,
}

impl Atlas {
    /// What [`update_atlas`] needs of this atlas.
    pub fn layout(&self) -> AtlasLayout {
        let faces = 0..self.surface.faces().len();
        let uv = |f: usize| {
            let (chart, local) = self.chart_of_face(f);
            self.charts[chart].disk().faces()[local].map(|v| self.charts[chart].uv()[v as usize])
        };
        AtlasLayout {
            corners: faces.clone().map(|f| self.surface.corners(f)).collect(),
            chart: faces.clone().map(|f| self.place_of_face[f][0]).collect(),
            corner_uv: faces.map(uv).collect(),
            sizes: self.charts.iter().map(|c| [c.width(), c.height()]).collect(),
            placements: self.placements.clone(),
            pages: self.pages.clone(),
            texel_m: self.texel_m,
        }
    }
}

impl AtlasLayout {
    fn check(&self, settings: &AtlasSettings) -> Result<(), Error> {
        let (faces, charts) = (self.corners.len(), self.sizes.len());
        for (what, expected, found) in [
            ("chart of the previous layout", faces, self.chart.len()),
            ("corner_uv of the previous layout", faces, self.corner_uv.len()),
            ("placements of the previous layout", charts, self.placements.len()),
        ] {
            if expected != found {
                return Err(Error::Length { what, expected, found });
            }
        }
        let pages = self.pages.len();
        let number = |k: usize, count: usize| if k < count { Ok(()) } else { Err(k) };
        let sound = self.chart.iter().try_for_each(|&c| number(c as usize, charts));
        let sound = sound.and_then(|()| self.placements.iter().try_for_each(|p| number(p.page, pages)));
        if let Err(value) = sound {
            let must_be = "a chart or a page of the previous layout";
            return Err(Error::Setting { name: "chart", value: value as f64, must_be });
        }
        pack::check_pages(&self.pages, self.texel_m)?;
        if self.texel_m.to_bits() != settings.pack.texel_m.to_bits() {
            let must_be = "that of the previous layout, whose texels are to stay";
            return Err(Error::Setting { name: "texel_m", value: settings.pack.texel_m, must_be });
        }
        Ok(())
    }
}

/// Lays out a surface of which an earlier state was laid out as `previous`. Faces are the same if their corners lie at the same places to the bit.
/// Charts of which every face is still there are kept. Those that lost faces get what came instead, if that can be laid out within the
/// bounds; otherwise what is left of them stays where it is. All else becomes new charts, which are merged to changed ones where they can be. Where
/// less than half of the faces is left, all is laid out anew.
///
/// # Errors
/// As [`unwrap_atlas`]; [`Error::Length`] and [`Error::Setting`] for a layout that is none, or of another texel.
pub fn update_atlas(
    previous: &AtlasLayout,
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    seams: &[[u32; 2]],
    settings: &AtlasSettings,
    mut progress: impl FnMut(Progress),
) -> Result<(Atlas, AtlasUpdate), Error> {
    previous.check(settings)?;
    let (surface, report) = Surface::new(positions, faces, settings.charts.join)?;
    let old = old_faces(previous, &surface);
    let kept_faces = old.iter().flatten().count();
    if 2 * kept_faces < surface.faces().len() {
        let atlas = unwrap_atlas(positions, faces, seams, settings, progress)?;
        let update = AtlasUpdate { new_charts: atlas.charts.len(), ..AtlasUpdate::default() };
        return Ok((atlas, update));
    }
    pack::check(&settings.pack, surface.area())?;
    settings.charts.check()?;
    let bounds = settings.charts.bounds();
    let mut charts = Charts::new(&surface, wanted_seams(&surface, seams)?);
    let touched = touched_charts(previous, &old);
    let members = old_members(previous, &surface, &old, &touched);
    place_old(previous, &old, &mut charts, &members);

    // Charts that stay where they are, whole or with a hole.
    let mut stay = HashSet::new();
    let mut pending = vec![true; surface.faces().len()];
    for (c, faces) in members.into_iter().enumerate().filter(|(_, faces)| !faces.is_empty()) {
        let refitted = touched[c]
            && charts.disk(&faces).is_some_and(|disk| {
                let start = spread(&charts, &faces, &disk, &old);
                let is_new: Vec<bool> = faces.iter().map(|&f| old[f as usize].is_none()).collect();
                // What came and little around it, so that all else stays to the bit; everything where that does not do, and much came.
                let came = is_new.iter().filter(|is_new| **is_new).count();
                let much = came as f64 >= REFITTED * faces.len() as f64;
                let uv = untangled(&disk, start.clone(), &is_new, bounds)
                    .or_else(|| if much { fit(&disk, start, bounds, None) } else { None });
                uv.map(|uv| charts.place(&faces, &disk, &uv)).is_some()
            });
        let left = if refitted { faces.clone() } else { largest_piece(&charts, &old, &faces) };
        let holds = !left.is_empty() && (refitted || charts.disk(&left).is_some());
        for f in faces {
            charts.chart[f as usize] = u32::MAX;
        }
        if holds {
            for &f in &left {
                (charts.chart[f as usize], pending[f as usize]) = (c as u32, false);
            }
            charts.members[c] = left;
            if !refitted {
                stay.insert(c as u32);
            }
        }
    }
    let first_new = charts.members.len() as u32;
    for faces in by_number(&pieces(&charts, &pending)) {
        add_region(&mut charts, faces, bounds, None);
    }
    if charts.members.len() as u32 > first_new {
        let costs = SeamCosts::new(&surface);
        let mut merging = ChartMerger::new(&mut charts, &costs, bounds, None, &mut progress);
        merging.only = Some((stay.clone(), first_new));
        merging.close_arcs();
    }
    let old_charts: Vec<u32> =
        (0..charts.members.len() as u32).filter(|&c| !charts.members[c as usize].is_empty()).collect();
    let homes = settle(previous, &old, &mut charts, &stay, &settings.pack);
    let sizes: HashMap<u32, [f64; 2]> = homes.iter().map(|(&c, &(size, _))| (c, size)).collect();
    let (done, members) = finish(
        charts,
        &Kept { whole: &[], sizes: &sizes },
        (settings.charts.bounds(), settings.charts.up),
        None,
        &mut progress,
    )?;
    let pieces: Vec<Piece> = done.iter().map(|c| Piece::new(c.uv(), c.disk().faces())).collect();
    let places: Vec<Option<Placement>> = old_charts.iter().map(|c| homes.get(c).map(|&(_, place)| place)).collect();
    let (placements, pages) = pack::add_to(&pieces, &places, &previous.pages, &settings.pack)?;
    let update = AtlasUpdate {
        kept_faces,
        kept_charts: old_charts.iter().filter(|c| **c < first_new && !touched[**c as usize]).count(),
        changed_charts: old_charts.iter().filter(|c| **c < first_new && touched[**c as usize]).count(),
        new_charts: old_charts.iter().filter(|c| **c >= first_new).count(),
        added_columns: pages[0][0].saturating_sub(previous.pages.first().map_or(0, |page| page[0])),
    };
    Ok((Atlas::of_parts(surface, report, done, members, placements, pages, settings.pack.texel_m)?, update))
}

/// A layout of old faces, and of new ones around which alone it may change.
fn untangled(disk: &Disk, start: Vec<[f64; 2]>, is_new: &[bool], bounds: Bounds) -> Option<Vec<[f64; 2]>> {
    let found = untangle(disk, start, is_new, bounds)?;
    (!found.parted.contains(&true) && keeps(disk, &found.uv, bounds)).then_some(found.uv)
}

/// Old charts that stay, or were laid out again and fit where they were: width and height, and place. Those that were laid out again are moved so that
/// what is left of them lies as near to where it was as a rigid motion can bring it.
fn settle(
    previous: &AtlasLayout,
    old: &[Option<(u32, usize)>],
    charts: &mut Charts,
    stay: &HashSet<u32>,
    settings: &PackSettings,
) -> BTreeMap<u32, ([f64; 2], Placement)> {
    let mut names: Vec<u32> =
        (0..previous.sizes.len() as u32).filter(|&c| !charts.members[c as usize].is_empty()).collect();
    names.sort_by_key(|&c| std::cmp::Reverse(charts.members[c as usize].len()));
    let mut sizes = Vec::with_capacity(names.len());
    let mut pieces = Vec::with_capacity(names.len());
    for &c in &names {
        let place = previous.placements[c as usize];
        let (size, slot) = if stay.contains(&c) {
            (previous.sizes[c as usize], PageSlot::Taken(place))
        } else {
            let (size, low) = move_back(previous, old, charts, c);
            let zero = Placement { shift: [0.0; 2], ..place }.apply(low);
            let shift = [0, 1].map(|k| place.shift[k] + zero[k]);
            (size, PageSlot::Wanted(Placement { shift, ..place }))
        };
        sizes.push(size);
        let faces: Vec<usize> = charts.members[c as usize].iter().map(|&f| f as usize).collect();
        // Every edge in the plane once from each side: what has no other side is the rim.
        let edges = |f: usize| (0..3).map(move |k| [3 * f + k, 3 * f + (k + 1) % 3]);
        let is_rim = |[h, _]: &[usize; 2]| {
            charts.is_seam(*h) || charts.surface.twin(*h).is_none_or(|twin| charts.chart[twin / 3] != c)
        };
        let rim = faces.iter().flat_map(|&f| edges(f)).filter(is_rim).map(|ends| ends.map(|h| charts.corner_uv[h]));
        pieces.push((Piece { rim: rim.collect() }, slot));
    }
    let places = pack::restore(&pieces, &previous.pages, settings);
    let settled = names.into_iter().zip(sizes).zip(places);
    settled.filter_map(|((c, size), place)| place.map(|place| (c, (size, place)))).collect()
}

/// Moves a chart that was laid out again, its box to the origin; returns the box, and where its lower left corner had been.
fn move_back(
    previous: &AtlasLayout,
    old: &[Option<(u32, usize)>],
    charts: &mut Charts,
    name: u32,
) -> ([f64; 2], [f64; 2]) {
    let faces: Vec<usize> = charts.members[name as usize].iter().map(|&f| f as usize).collect();
    let mut pairs = Vec::new();
    for &f in &faces {
        if let Some((o, turn)) = old[f].filter(|(o, _)| previous.chart[*o as usize] == name) {
            let there = |k: usize| previous.corner_uv[o as usize][(k + turn) % 3];
            pairs.extend((0..3).map(|k| (1.0, there(k), charts.corner_uv[3 * f + k])));
        }
    }
    // Most of it was not touched: then nothing is turned, which would round.
    let same = 2 * pairs.iter().filter(|(_, there, here)| there == here).count() >= pairs.len();
    let motion = procrustes(&pairs, same);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for h in faces.iter().flat_map(|&f| 3 * f..3 * f + 3) {
        if !same {
            charts.corner_uv[h] = motion.apply(charts.corner_uv[h]);
        }
        for k in 0..2 {
            low[k] = low[k].min(charts.corner_uv[h][k]);
            high[k] = high[k].max(charts.corner_uv[h][k]);
        }
    }
    for h in faces.iter().flat_map(|&f| 3 * f..3 * f + 3) {
        charts.corner_uv[h] = [0, 1].map(|k| charts.corner_uv[h][k] - low[k]);
    }
    ([0, 1].map(|k| high[k] - low[k]), low)
}

/// For every face of the surface the face of the layout at the same place, and which of its corners is the first.
fn old_faces(previous: &AtlasLayout, surface: &Surface) -> Vec<Option<(u32, usize)>> {
    let key = |corners: [[f64; 3]; 3]| {
        let bits = corners.map(|p| p.map(f64::to_bits));
        let first = (0..3).min_by_key(|&k| bits[k]).unwrap_or(0);
        ([0, 1, 2].map(|k| bits[(first + k) % 3]), first)
    };
    let mut by_place = HashMap::with_capacity(previous.corners.len());
    for (f, &corners) in previous.corners.iter().enumerate() {
        let (key, first) = key(corners);
        by_place.entry(key).or_insert((f as u32, first));
    }
    (0..surface.faces().len())
        .map(|f| {
            let (key, first) = key(surface.corners(f));
            // A face of which there are two is taken once.
            by_place.remove(&key).map(|(old, old_first)| (old, (old_first + 3 - first) % 3))
        })
        .collect()
}

/// Charts of which a face is gone.
fn touched_charts(previous: &AtlasLayout, old: &[Option<(u32, usize)>]) -> Vec<bool> {
    let mut missing = vec![true; previous.corners.len()];
    for (f, _) in old.iter().flatten() {
        missing[*f as usize] = false;
    }
    let mut touched = vec![false; previous.sizes.len()];
    for (&chart, _) in previous.chart.iter().zip(&missing).filter(|(_, missing)| **missing) {
        touched[chart as usize] = true;
    }
    touched
}

/// The faces of every old chart: those that are left, and the new ones nearest to a chart that lost some.
fn old_members(
    previous: &AtlasLayout,
    surface: &Surface,
    old: &[Option<(u32, usize)>],
    touched: &[bool],
) -> Vec<Vec<u32>> {
    let mut chart: Vec<u32> = old.iter().map(|o| o.map_or(u32::MAX, |(f, _)| previous.chart[f as usize])).collect();
    let mut front: Vec<u32> = (0..chart.len() as u32).filter(|&f| chart[f as usize] != u32::MAX).collect();
    front.retain(|&f| touched[chart[f as usize] as usize]);
    let mut next = 0;
    while let Some(&f) = front.get(next) {
        next += 1;
        for twin in (3 * f as usize..3 * f as usize + 3).filter_map(|h| surface.twin(h)) {
            if chart[twin / 3] == u32::MAX {
                chart[twin / 3] = chart[f as usize];
                front.push((twin / 3) as u32);
            }
        }
    }
    let mut members = vec![Vec::new(); previous.sizes.len()];
    for (f, &c) in chart.iter().enumerate().filter(|(_, c)| **c != u32::MAX) {
        members[c as usize].push(f as u32);
    }
    members
}

/// Every old face where it was, and the cuts within charts.
fn place_old(previous: &AtlasLayout, old: &[Option<(u32, usize)>], charts: &mut Charts, members: &[Vec<u32>]) {
    charts.members = vec![Vec::new(); members.len()];
    for (c, faces) in members.iter().enumerate() {
        for &f in faces {
            charts.chart[f as usize] = c as u32;
        }
    }
    for (f, place) in old.iter().enumerate() {
        if let &Some((o, turn)) = place {
            for k in 0..3 {
                charts.corner_uv[3 * f + k] = previous.corner_uv[o as usize][(k + turn) % 3];
            }
        }
    }
    let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
    for h in 0..3 * old.len() {
        let Some(twin) = charts.surface.twin(h) else { continue };
        if old[h / 3].is_some() && old[twin / 3].is_some() && charts.chart[h / 3] == charts.chart[twin / 3] {
            let uv = &charts.corner_uv;
            charts.cut[h] = uv[h] != uv[next(twin)] || uv[next(h)] != uv[twin];
        }
    }
}

/// Places of all vertices of a disk: old ones where they were, new ones between their neighbours.
fn spread(charts: &Charts, faces: &[u32], disk: &Disk, old: &[Option<(u32, usize)>]) -> Vec<[f64; 2]> {
    let mut uv = vec![[0.0; 2]; disk.positions.len()];
    let mut known = vec![false; uv.len()];
    let mut neighbours = vec![Vec::new(); uv.len()];
    for (&f, corners) in faces.iter().zip(&disk.faces) {
        for k in 0..3 {
            let [v, w] = [corners[k], corners[(k + 1) % 3]];
            neighbours[v as usize].push(w as usize);
            neighbours[w as usize].push(v as usize);
            if old[f as usize].is_some() {
                uv[v as usize] = charts.corner_uv[3 * f as usize + k];
                known[v as usize] = true;
            }
        }
    }
    let free: Vec<usize> = (0..uv.len()).filter(|&v| !known[v]).collect();
    let placed = (uv.len() - free.len()).max(1) as f64;
    let middle = [0, 1].map(|k| uv.iter().map(|p| p[k]).sum::<f64>() / placed);
    for &v in &free {
        uv[v] = middle;
    }
    for _ in 0..SWEEPS {
        for &v in &free {
            let count = neighbours[v].len() as f64;
            uv[v] = [0, 1].map(|k| neighbours[v].iter().map(|&w| uv[w][k]).sum::<f64>() / count);
        }
    }
    uv
}

/// The old ones among the faces of a chart that still hang together, without what is cut off from most of them.
fn largest_piece(charts: &Charts, old: &[Option<(u32, usize)>], faces: &[u32]) -> Vec<u32> {
    let mut free: HashSet<u32> = faces.iter().copied().filter(|&f| old[f as usize].is_some()).collect();
    let mut largest = Vec::new();
    for &start in faces {
        if !free.remove(&start) {
            continue;
        }
        let piece = charts.piece(start, |g| free.remove(&g));
        if piece.len() > largest.len() {
            largest = piece;
        }
    }
    largest.sort_unstable();
    largest
}

/// Number of the connected piece of every face that has no chart.
fn pieces(charts: &Charts, pending: &[bool]) -> Vec<u32> {
    let mut number = vec![u32::MAX; pending.len()];
    let mut count = 0;
    for start in 0..pending.len() {
        if !pending[start] || number[start] != u32::MAX {
            continue;
        }
        number[start] = count;
        let mut stack = vec![start];
        while let Some(f) = stack.pop() {
            for h in (3 * f..3 * f + 3).filter(|&h| !charts.wanted[h]) {
                if let Some(g) = charts.surface.twin(h).map(|twin| twin / 3)
                    && pending[g]
                    && number[g] == u32::MAX
                {
                    number[g] = count;
                    stack.push(g);
                }
            }
        }
        count += 1;
    }
    number
}
