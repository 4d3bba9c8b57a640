//! A surface divided among robots: two cells side by side for each, of equal work.
//!
//! All robots work in their first cells at the same time, then in their second: between two of them lies always a cell that nobody is in. A
//! hose that comes from the ground behind the cells of its robot crosses no other.

use nalgebra::{Matrix2, SymmetricEigen, UnitVector3, Vector3};

use super::team::Team;
use crate::error::Error;
use crate::settings::{Settings, TimingPolicy};
use crate::target::Target;

/// A cell between two robots is wider than their distance by this, m: normals that lean sideways take vehicles beyond their cell.
const BEYOND: f64 = 0.5;
/// Pieces of strokes that are shorter than this, m, stay in the cell of what is before them.
const SLIVER: f64 = 0.1;
/// Halvings of the work of the fullest cell.
const HALVINGS: usize = 50;

/// Cells side by side along a level direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    along: UnitVector3<f64>,
    /// Coordinates along it, rising, m.
    borders: Vec<f64>,
}

/// A piece of a stroke: where it lies along the direction, m, and how long it takes, s.
#[derive(Clone, Copy)]
struct Work {
    at: f64,
    time: f64,
}

impl Cells {
    /// Cells of equal work for strokes of a team: one for one robot, two for each of several, of as many robots as there is room for. Work is the
    /// time of the spot along the strokes, at the speed of [`TimingSettings`](crate::timing::TimingSettings) or what the dose and the greatest flow allow, with a stop at the end of each.
    /// The cells lie along the level direction in which the strokes reach farthest.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn of_equal_work(strokes: &[Vec<Target>], team: &Team, settings: &Settings) -> Result<Self, Error> {
        team.check()?;
        let along = farthest_level_direction(strokes);
        let mut work: Vec<Work> = strokes.iter().flat_map(|stroke| work_of(stroke, &along, settings)).collect();
        work.sort_by(|a, b| a.at.total_cmp(&b.at));
        let width = work.last().map_or(0.0, |last| last.at) - work.first().map_or(0.0, |first| first.at);
        let least = team.apart + BEYOND;
        // All cells but the first and the last lie between two robots.
        let robots = team.robots.min(1 + ((width - 1e-9) / (2.0 * least)) as usize);
        if robots == 1 {
            return Ok(Self { along, borders: Vec::new() });
        }
        let total: f64 = work.iter().map(|work| work.time).sum();
        let cells = 2 * robots;
        let divide = |most: f64| borders(&work, cells, least, most);
        let (mut low, mut high) = (total / cells as f64, total);
        // All work in one cell leaves the others as narrow as they may be.
        let mut best = divide(high).unwrap_or_default();
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match divide(middle) {
                Some(borders) => (best, high) = (borders, middle),
                None => low = middle,
            }
        }
        Ok(Self { along, borders: best })
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.borders.len() + 1
    }

    /// Strokes of each cell: those that cross a border are cut there, at a target. The dose of each piece ends with it.
    pub fn divide(&self, strokes: &[Vec<Target>]) -> Vec<Vec<Vec<Target>>> {
        let mut cells = vec![Vec::new(); self.count()];
        for stroke in strokes {
            for (cell, range) in self.pieces(stroke) {
                let mut piece = stroke[range].to_vec();
                if let Some(last) = piece.last_mut() {
                    last.dose = 0.0;
                }
                cells[cell].push(piece);
            }
        }
        cells
    }

    /// Cell and targets of each piece of a stroke that sprays.
    fn pieces(&self, stroke: &[Target]) -> Vec<(usize, std::ops::RangeInclusive<usize>)> {
        let mut pieces: Vec<(usize, std::ops::RangeInclusive<usize>, f64)> = Vec::new();
        for (k, pair) in stroke.windows(2).enumerate() {
            let at = middle(pair).dot(&self.along);
            let cell = self.borders.partition_point(|border| *border <= at);
            let length = (pair[1].point - pair[0].point).norm();
            match pieces.last_mut() {
                Some((same, range, sum)) if *same == cell || *sum < SLIVER => {
                    // What was too short to be a piece goes along with what follows.
                    (*same, *range, *sum) = (cell, *range.start()..=k + 1, *sum + length);
                }
                _ => pieces.push((cell, k..=k + 1, length)),
            }
        }
        if let [.., (_, before, _), (_, last, sum)] = &mut pieces[..]
            && *sum < SLIVER
        {
            *before = *before.start()..=*last.end();
            pieces.pop();
        }
        let sprays = |range: &std::ops::RangeInclusive<usize>| {
            stroke[*range.start()..*range.end()].iter().any(|target| target.dose > 0.0)
        };
        pieces.into_iter().map(|(cell, range, _)| (cell, range)).filter(|(_, range)| sprays(range)).collect()
    }
}

fn middle(pair: &[Target]) -> Vector3<f64> {
    0.5 * (pair[0].point.coords + pair[1].point.coords)
}

/// The first principal direction of the targets in the ground plan.
fn farthest_level_direction(strokes: &[Vec<Target>]) -> UnitVector3<f64> {
    let points = || strokes.iter().flatten().map(|target| target.point.coords.xy());
    let mean = points().sum::<nalgebra::Vector2<f64>>() / points().count().max(1) as f64;
    let spread: Matrix2<f64> = points().map(|point| (point - mean) * (point - mean).transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let first = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    // Of the two signs always the same.
    let sign = if first[first.iamax()] < 0.0 { -1.0 } else { 1.0 };
    UnitVector3::try_new(Vector3::new(sign * first.x, sign * first.y, 0.0), 1e-9).unwrap_or(Vector3::y_axis())
}

/// What a stroke takes, target by target; its stop at the end belongs to the last.
fn work_of(stroke: &[Target], along: &Vector3<f64>, settings: &Settings) -> Vec<Work> {
    let timing = &settings.timing;
    let speed = match timing.policy {
        TimingPolicy::Uniform { speed } => speed.min(timing.max_speed),
        TimingPolicy::GradientPreserving => timing.max_speed,
    };
    let of_pair = |pair: &[Target]| {
        let length = (pair[1].point - pair[0].point).norm();
        Work { at: middle(pair).dot(along), time: (length / speed).max(pair[0].dose * length / timing.max_flow) }
    };
    let mut work: Vec<Work> = stroke.windows(2).map(of_pair).collect();
    if let Some(last) = work.last_mut() {
        last.time += 2.0 * speed / timing.max_acceleration;
    }
    work
}

/// Borders of cells none of which has more than `most` to do, from left to right as far as that allows, cells between two others no narrower than
/// `least`; `None` if there are none.
fn borders(work: &[Work], cells: usize, least: f64, most: f64) -> Option<Vec<f64>> {
    let (first, last) = (work.first()?.at, work.last()?.at);
    let (mut from, mut next) = (first, 0);
    let mut borders = Vec::with_capacity(cells - 1);
    for cell in 0..cells - 1 {
        let begun = next;
        let mut done = 0.0;
        let narrowest = if cell == 0 { first } else { from + least };
        let widest = last - least * (cells - 2 - cell) as f64;
        if narrowest > widest {
            return None;
        }
        while let Some(piece) = work.get(next)
            && piece.at < widest
            && (done + piece.time <= most || piece.at < narrowest)
        {
            done += piece.time;
            next += 1;
        }
        if done > most && next > begun {
            return None;
        }
        from = work.get(next).map_or(last, |piece| piece.at).clamp(narrowest, widest);
        borders.push(from);
    }
    let left: f64 = work[next..].iter().map(|piece| piece.time).sum();
    (left <= most).then_some(borders)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// Rows of a wall along y, every 10 cm, with a dose that may change along them.
    fn rows(width: f64, dose: &dyn Fn(f64) -> f64) -> Vec<Vec<Target>> {
        let count = (width / 0.05).round() as usize;
        let target = |row: usize, k: usize| Target {
            point: Point3::new(0.0, 0.05 * k as f64, 0.1 * row as f64),
            normal: -Vector3::x_axis(),
            dose: if k < count { dose(0.05 * k as f64) } else { 0.0 },
            time: None,
            stand_off: None,
        };
        (0..20).map(|row| (0..=count).map(|k| target(row, k)).collect()).collect()
    }

    fn volume(strokes: &[Vec<Target>]) -> f64 {
        let of = |stroke: &Vec<Target>| {
            stroke.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum::<f64>()
        };
        strokes.iter().map(of).sum()
    }

    fn time(strokes: &[Vec<Target>], settings: &Settings) -> f64 {
        strokes.iter().flat_map(|stroke| work_of(stroke, &Vector3::y(), settings)).map(|work| work.time).sum()
    }

    #[test]
    fn cells_have_equal_work_and_keep_all_paint() {
        let settings = Settings::default();
        // Beyond 20 m the dose asks for a quarter of the speed.
        let slow = 4.0 * settings.timing.max_flow / 0.4;
        let strokes = rows(40.0, &|y| if y < 20.0 { 1e-6 } else { slow });
        let team = Team { robots: 3, ..Team::default() };
        let cells = Cells::of_equal_work(&strokes, &team, &settings).unwrap();
        assert_eq!(cells.count(), 6);
        let divided = cells.divide(&strokes);
        let paint: f64 = divided.iter().map(|strokes| volume(strokes)).sum();
        assert!((paint / volume(&strokes) - 1.0).abs() < 1e-12);
        let times: Vec<f64> = divided.iter().map(|strokes| time(strokes, &settings)).collect();
        let mean = times.iter().sum::<f64>() / 6.0;
        assert!(times.iter().all(|time| (time / mean - 1.0).abs() < 0.02), "{times:?}");
        let wide = |strokes: &[Vec<Target>]| {
            let y = || strokes.iter().flatten().map(|target| target.point.y);
            y().fold(f64::MIN, f64::max) - y().fold(f64::MAX, f64::min)
        };
        // A hundred units of work, four of which are done in the first half for each one: 16.7 m, 3.33 m and 4 x 5 m hold as much as each other.
        assert!(wide(&divided[0]) > 16.0 && wide(&divided[5]) < 5.0, "{} {}", wide(&divided[0]), wide(&divided[5]));
    }

    #[test]
    fn inner_cells_keep_robots_apart_where_all_work_is_in_one_place() {
        let settings = Settings::default();
        let slow = 100.0 * settings.timing.max_flow / 0.4;
        let strokes = rows(12.0, &|y| if (5.0..6.0).contains(&y) { slow } else { 1e-6 });
        let cells = Cells::of_equal_work(&strokes, &Team { robots: 2, ..Team::default() }, &settings).unwrap();
        let widths: Vec<f64> = cells.borders.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(widths.iter().all(|width| *width >= 2.5 - 1e-9), "{widths:?}");
        assert!(cells.borders.iter().all(|border| (0.0..=12.0).contains(border)));
    }

    #[test]
    fn a_narrow_wall_is_divided_among_those_it_has_room_for() {
        // A cell between two robots takes 2.5 m, and n robots have 2 n - 2 of them.
        for (width, robots) in [(0.0, 1), (4.8, 1), (5.2, 2), (9.8, 2), (10.2, 3), (20.2, 4)] {
            let strokes = rows(width, &|_| 1e-6);
            let cells = Cells::of_equal_work(&strokes, &Team { robots: 4, ..Team::default() }, &Settings::default());
            assert_eq!(cells.unwrap().count(), if robots == 1 { 1 } else { 2 * robots }, "{width} m");
        }
        let none = Cells::of_equal_work(&[], &Team { robots: 4, ..Team::default() }, &Settings::default());
        assert_eq!(none.unwrap().count(), 1);
    }

    #[test]
    fn a_stroke_along_a_border_is_not_torn() {
        let cells = Cells { along: Vector3::y_axis(), borders: vec![0.5] };
        // Two targets on one side, two on the other, and so on.
        let point = |k: usize| Point3::new(0.0, if (k / 2).is_multiple_of(2) { 0.49 } else { 0.52 }, 0.02 * k as f64);
        let target =
            |k| Target { point: point(k), normal: -Vector3::x_axis(), dose: 1e-6, time: None, stand_off: None };
        let stroke: Vec<Target> = (0..30).map(target).collect();
        let divided = cells.divide(std::slice::from_ref(&stroke));
        assert!(divided.iter().flatten().all(|piece| piece.len() > 2), "{divided:?}");
        let targets: usize = divided.iter().flatten().map(|piece| piece.len() - 1).sum();
        assert_eq!(targets, stroke.len() - 1);
    }
}
