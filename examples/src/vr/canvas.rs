//! Paint on the surface as a picture that changes: films of every paint, wet in wet, and the pixels that have to be drawn again.

use paint_sim::colour::{BANDS, spectrum_srgb8};
use paint_sim::{Film, Shot, SprayModel, Surface, km};

use super::palette::PaletteEntry;
use super::world::VrWorld;

/// A rectangle of the atlas, sRGB.
pub(super) struct Patch {
    pub(super) left: u16,
    pub(super) top: u16,
    pub(super) width: u16,
    pub(super) height: u16,
    pub(super) rgb: Vec<u8>,
}

/// The films and their picture.
pub(super) struct Canvas {
    films: Vec<Film>,
    /// The paints in the order in which they were first sprayed.
    order: Vec<usize>,
    /// Pixel of every texel of the films.
    pixels: Vec<u32>,
    columns: usize,
    rows: usize,
    rgb: Vec<u8>,
    /// Texels whose colour is out of date, and a mark for each so that none is listed twice.
    stale: Vec<u32>,
    marked: Vec<bool>,
}

impl Canvas {
    /// A bare surface.
    pub(super) fn new(world: &VrWorld) -> Result<Self, paint_sim::Error> {
        let (texels, pixels) = world.surface.film_texels();
        let first = Film::new(texels)?;
        let mut films: Vec<Film> = (1..world.palette.len()).map(|_| first.layer()).collect();
        films.push(first);
        let (columns, rows) = (world.surface.width(), world.surface.height());
        let bare = world.ground.srgb().rgb;
        Ok(Self {
            marked: vec![false; pixels.len()],
            pixels: pixels.into_iter().map(|pixel| pixel as u32).collect(),
            films,
            order: Vec::new(),
            columns,
            rows,
            rgb: std::iter::repeat_n(bare, columns * rows).flatten().collect(),
            stale: Vec::new(),
        })
    }

    /// Sprays a paint.
    pub(super) fn spray(
        &mut self,
        paint: u8,
        shots: &[Shot],
        model: &SprayModel,
        surface: &dyn Surface,
    ) -> Result<(), paint_sim::Error> {
        let Self { films, order, stale, marked, .. } = self;
        let touched = &mut |texel| mark(texel, stale, marked);
        let paint = usize::from(paint).min(films.len() - 1);
        if !order.contains(&paint) {
            order.push(paint);
        }
        films[paint].deposit_observed(shots, model, surface, 1, touched, &mut |_, _| ()).map(|_| ())
    }

    /// Takes a paint back that was sprayed before.
    pub(super) fn withdraw(
        &mut self,
        paint: u8,
        shots: &[Shot],
        model: &SprayModel,
        surface: &dyn Surface,
    ) -> Result<(), paint_sim::Error> {
        let Self { films, stale, marked, .. } = self;
        let paint = usize::from(paint).min(films.len() - 1);
        films[paint].withdraw(shots, model, surface, 1, &mut |texel| mark(texel, stale, marked))
    }

    /// Draws what has changed since the last call and returns the rectangle about it.
    pub(super) fn take_patch(&mut self, world: &VrWorld) -> Option<Patch> {
        let stale = std::mem::take(&mut self.stale);
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for texel in stale {
            self.marked[texel as usize] = false;
            let pixel = self.pixels[texel as usize] as usize;
            let colour = self.colour(texel as usize, world);
            self.rgb[3 * pixel..3 * pixel + 3].copy_from_slice(&colour);
            let place = [pixel % self.columns, pixel / self.columns];
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(place[k]), high[k].max(place[k]));
            }
        }
        (low[0] <= high[0]).then(|| self.patch(low, [high[0] - low[0] + 1, high[1] - low[1] + 1]))
    }

    /// All of the picture.
    pub(super) fn whole(&self) -> Patch {
        self.patch([0, 0], [self.columns, self.rows])
    }

    /// Paint on the surface, m^3.
    pub(super) fn volume(&self) -> f64 {
        self.films.iter().map(|film| film.mass_balance().deposited as f64).sum::<f64>() * paint_sim::spray::QUANTUM
    }

    /// Thickness of all paints together on every pixel, m; 0 beside the surface.
    pub(super) fn thickness(&self) -> Vec<f64> {
        self.thickness_of(&self.films)
    }

    /// The paints that are on the surface, in the order in which they were first sprayed, each with its thickness on every pixel, m.
    pub(super) fn paints(&self) -> Vec<(usize, Vec<f64>)> {
        let on_wall = |paint: &&usize| self.films[**paint].volumes().iter().any(|volume| *volume > 0);
        self.order.iter().filter(on_wall).map(|&k| (k, self.thickness_of(&self.films[k..=k]))).collect()
    }

    fn thickness_of(&self, films: &[Film]) -> Vec<f64> {
        let mut thickness = vec![0.0; self.columns * self.rows];
        for (texel, &pixel) in self.pixels.iter().enumerate() {
            thickness[pixel as usize] = films.iter().map(|film| film.thickness(texel)).sum();
        }
        thickness
    }

    /// Wet in wet: absorption and scattering add up by thickness (Duncan 1940), over the bare surface.
    fn colour(&self, texel: usize, world: &VrWorld) -> [u8; 3] {
        let (mut absorption, mut scattering) = ([0.0; BANDS], [0.0; BANDS]);
        for (number, PaletteEntry { paint, .. }) in world.palette.iter().enumerate() {
            let thickness = self.films[number].thickness(texel);
            if thickness > 0.0 {
                for band in 0..BANDS {
                    absorption[band] += thickness * paint.absorption()[band];
                    scattering[band] += thickness * paint.scattering()[band];
                }
            }
        }
        let ground = world.ground.reflectance();
        let band = |k: usize| km::reflectance(absorption[k], scattering[k], 1.0, ground[k]);
        spectrum_srgb8(&std::array::from_fn(band)).rgb
    }

    fn patch(&self, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Patch {
        let row = |y: usize| &self.rgb[3 * (y * self.columns + left)..3 * (y * self.columns + left + width)];
        Patch {
            left: left as u16,
            top: top as u16,
            width: width as u16,
            height: height as u16,
            rgb: (top..top + height).flat_map(row).copied().collect(),
        }
    }
}

fn mark(texel: u32, stale: &mut Vec<u32>, marked: &mut [bool]) {
    if !std::mem::replace(&mut marked[texel as usize], true) {
        stale.push(texel);
    }
}

#[cfg(test)]
mod tests {
    use super::super::world::tests::wall;
    use super::*;
    use nalgebra::{Point3, Vector3};

    /// Thick paint hides the wall: what is seen is its reflectance at infinite thickness, `1 + K/S - sqrt((K/S)^2 + 2 K/S)` (Kubelka 1948).
    #[test]
    fn thick_paint_has_its_own_colour() {
        let world = wall(0.0402);
        for (number, PaletteEntry { paint, .. }) in world.palette.iter().enumerate() {
            let mut canvas = Canvas::new(&world).unwrap();
            let (origin, axis) = (Point3::new(-0.3, 0.0, 2.0), Vector3::x_axis());
            let shots = vec![Shot { origin, axis, volume: 1e-5 }; 100];
            canvas.spray(number as u8, &shots, &SprayModel::default(), &world.surface.world).unwrap();
            let patch = canvas.take_patch(&world).unwrap();
            let thickness = canvas.thickness();
            let thickest = (0..thickness.len()).max_by(|a, b| thickness[*a].total_cmp(&thickness[*b])).unwrap();
            let [x, y] =
                [thickest % canvas.columns - patch.left as usize, thickest / canvas.columns - patch.top as usize];
            let at = 3 * (y * patch.width as usize + x);
            let masstone = |k: usize| {
                let ratio = paint.absorption()[k] / paint.scattering()[k];
                1.0 + ratio - (ratio * ratio + 2.0 * ratio).sqrt()
            };
            let expected = spectrum_srgb8(&std::array::from_fn(masstone)).rgb;
            for (found, expected) in patch.rgb[at..at + 3].iter().zip(expected) {
                assert!(found.abs_diff(expected) <= 1, "paint {number}: {:?}", &patch.rgb[at..at + 3]);
            }
        }
    }
}
