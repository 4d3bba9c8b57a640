//! The paint on the front of a surface while it is sprayed, as a grey camera sees it.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::film::inspection::GreyPaint;
use paint_sim::flight::{FlightLog, FlightSample};
use paint_sim::{Error, Film, Paint, Shot, SprayModel, Surface, Texel, TriangleSurface};

/// Edge of a texel seen from the front, metres: below the deviation of a spot.
const TEXEL: f64 = 0.01;
/// Larger ones where there would be more than this.
const MOST_TEXELS: f64 = 1e6;
/// A texel seen at a flatter angle than this cosine stands for no more surface.
const FLATTEST: f64 = 0.1;
/// Motion of the nozzle that one shot stands for, metres: widens the spot by less than a percent.
pub const SHOT_STEP: f64 = 0.01;
/// Wavelength that the camera sees, nanometres: the middle of a silicon sensor's band behind an infrared filter.
pub const SEEN: f64 = 550.0;

/// A film on texels that are square from the front.
#[derive(Clone)]
pub struct PaintedFront {
    film: Film,
    /// The film's texel of a square, row by row from the lowest; `None` where there is nothing.
    squares: Vec<Option<u32>>,
    width: usize,
    edge: f64,
    side: Vector3<f64>,
    /// Of the lowest left corner, along `side` and upwards.
    corner: [f64; 2],
    spray: SprayModel,
    paint: GreyPaint,
    /// What has left the nozzle since the last image.
    flown: FlightLog,
}

impl PaintedFront {
    /// Nothing is painted yet. `towards`: level, from the camera to the surface.
    ///
    /// # Errors
    /// A surface that has no front seen along `towards`.
    pub fn new(
        surface: &TriangleSurface,
        towards: &UnitVector3<f64>,
        spray: SprayModel,
        paint: &Paint,
    ) -> Result<Self, Error> {
        let side = towards.cross(&Vector3::z());
        let [(left, right), (bottom, top), (front, back)] =
            [&side, &Vector3::z(), towards.as_ref()].map(|axis| surface.extent(axis));
        let edge = TEXEL.max(((right - left) * (top - bottom) / MOST_TEXELS).sqrt());
        let [width, height] = [right - left, top - bottom].map(|length| (length / edge).ceil().max(1.0) as usize);
        let mut texels = Vec::new();
        let squares = (0..width * height).map(|k| {
            let [along, up] = [left + (k % width) as f64 * edge, bottom + (k / width) as f64 * edge];
            let from =
                side * (along + 0.5 * edge) + Vector3::z() * (up + 0.5 * edge) + towards.as_ref() * (front - 1.0);
            let hit = surface.cast(&Point3::from(from), towards, back - front + 2.0)?;
            let normal = UnitVector3::try_new(-hit.normal * hit.normal.dot(towards).signum(), 1e-9)?;
            let area = edge * edge / normal.dot(towards).abs().max(FLATTEST);
            texels.push(Texel { point: (from + towards.as_ref() * hit.distance).into(), normal, area });
            u32::try_from(texels.len() - 1).ok()
        });
        let squares = squares.collect();
        Ok(Self {
            film: Film::new(texels)?,
            squares,
            width,
            edge,
            side,
            corner: [left, bottom],
            spray,
            paint: GreyPaint::at(paint, SEEN),
            flown: FlightLog { samples: Vec::new(), interval: 0.0 },
        })
    }

    /// Sprays onto it.
    ///
    /// # Errors
    /// Shots that are not finite.
    pub fn spray(&mut self, shots: &[Shot], surface: &TriangleSurface, threads: usize) -> Result<(), Error> {
        if !shots.is_empty() {
            self.film.deposit(shots, &self.spray, surface, threads, &mut |_, _| ())?;
        }
        Ok(())
    }

    /// A sample of the flight with the paint that leaves the nozzle until the next one, `interval` seconds later.
    pub(super) fn fly(&mut self, sample: &FlightSample, interval: f64) {
        self.flown.interval = interval;
        self.flown.samples.push(*sample);
    }

    /// What has left the nozzle is on the surface.
    pub(super) fn land(&mut self, surface: &TriangleSurface, threads: usize) -> Result<(), Error> {
        let shots = self.flown.shots(SHOT_STEP);
        self.flown.samples.clear();
        self.spray(&shots, surface, threads)
    }

    /// Albedo of a place whose ground has the given one.
    pub(super) fn albedo(&self, place: &Point3<f64>, ground: f64) -> f64 {
        let thickness = self.thickness(place);
        if thickness > 0.0 { self.paint.reflectance(thickness, ground) } else { ground }
    }

    /// Thickness of the paint at a place, m: bilinear, as steps between texels would be corners to follow.
    fn thickness(&self, place: &Point3<f64>) -> f64 {
        let [x, y] =
            [place.coords.dot(&self.side) - self.corner[0], place.z - self.corner[1]].map(|m| m / self.edge - 0.5);
        let at = |x: f64, y: f64| {
            let (x, y) = (x.clamp(0.0, (self.width - 1) as f64) as usize, y.max(0.0) as usize);
            let texel = self.squares.get(y * self.width + x).copied().flatten();
            texel.map_or(0.0, |texel| self.film.thickness(texel as usize))
        };
        let (left, low) = (x.floor(), y.floor());
        let (right, high) = (x - left, y - low);
        let row = |y: f64| at(left, y) * (1.0 - right) + at(left + 1.0, y) * right;
        row(low) * (1.0 - high) + row(low + 1.0) * high
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at x = 2 that faces -x.
    fn wall() -> TriangleSurface {
        let corners = [[2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 2.0], [2.0, -1.0, 2.0]];
        TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    #[test]
    fn a_shot_is_seen_where_it_lands_as_deep_as_its_cone_says() {
        let surface = wall();
        let spray = SprayModel { sigma: 0.1_f64.atan(), cut: 5.0, ..SprayModel::default() };
        // Black: absorbs and does not scatter, so two ways through it are all that happens (Beer and Lambert).
        let paint = Paint::new(&[1.0; 36], &[0.0; 36], 1e-5).unwrap();
        let mut front = PaintedFront::new(&surface, &Vector3::x_axis(), spray, &paint).unwrap();
        let volume = 1e-8;
        let shot = Shot { origin: Point3::new(1.5, 0.3, 1.2), axis: Vector3::x_axis(), volume };
        front.spray(&[shot], &surface, 1).unwrap();
        // Half a metre away, its deviation is 5 cm.
        for (y, z) in [(0.3, 1.2), (0.35, 1.2), (0.26, 1.16), (0.3, 1.26)] {
            let r2 = (y - 0.3_f64).powi(2) + (z - 1.2_f64).powi(2);
            let thickness = volume / (std::f64::consts::TAU * 0.0025) * (-r2 / 0.005).exp();
            let place = Point3::new(2.0, y, z);
            assert!(
                (front.thickness(&place) / thickness - 1.0).abs() < 0.02,
                "{} {thickness}",
                front.thickness(&place)
            );
            let expected = 0.4 * (-2.0 * 1e5 * thickness).exp();
            assert!((front.albedo(&place, 0.4) - expected).abs() < 0.005, "{}", front.albedo(&place, 0.4));
        }
        for away in [Point3::new(2.0, -0.5, 1.2), Point3::new(2.0, 7.0, 1.0), Point3::new(2.0, 0.3, -3.0)] {
            assert!((front.albedo(&away, 0.4) - 0.4).abs() < 1e-12);
        }
    }
}
