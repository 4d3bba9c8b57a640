//! The thickness of a film, from the light that the surface sends out without and with it.

use crate::colour::wavelength;
use crate::error::{Error, check_positive, check_range};
use crate::film::Texel;
use crate::km;
use crate::paint::Paint;

use super::lighting::Lighting;
use super::mosaic::{Mosaic, TexelLight};

/// Reflectances of ground and opaque paint that are nearer to each other than this cannot be told apart.
const LEAST_CONTRAST: f64 = 0.02;
/// A film within so many deviations of opaque is opaque.
const OPAQUE: f64 = 2.0;
/// Reflectances of ground that exist.
const GROUND: [f64; 2] = [0.005, 0.98];
/// Halvings of the interval of thickness.
const HALVINGS: usize = 50;
/// No film is thicker, m.
const THICKEST: f64 = 1e-2;

/// A paint as a camera of one channel sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreyPaint {
    /// Absorption, per metre.
    pub absorption: f64,
    /// Scattering, per metre.
    pub scattering: f64,
}

impl GreyPaint {
    /// A paint in the band nearest to a wavelength, nm.
    pub fn at(paint: &Paint, nanometres: f64) -> Self {
        let off = |band: &usize| (wavelength(*band) - nanometres).abs();
        let band = (0..paint.absorption().len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default();
        Self { absorption: paint.absorption()[band], scattering: paint.scattering()[band] }
    }

    /// Reflectance of a film on a ground, as [`km::reflectance`].
    pub fn reflectance(&self, thickness: f64, ground: f64) -> f64 {
        km::reflectance(self.absorption, self.scattering, thickness, ground)
    }
}

/// The film on a texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmEstimate {
    /// Thickness, m; at least so much where it is opaque.
    pub thickness: f64,
    /// Standard deviation by the noise of the pictures, m; it does not know of wrong poses or moved shadows.
    pub sigma: f64,
    /// More paint would look the same.
    pub opaque: bool,
}

/// The film on every texel that both mosaics have seen and that would show it; `None` of the others.
///
/// `bare` names texels that no paint was meant for: their change is the light's, and the light is smooth. `None`: light and exposure were the
/// same in both. `ground` is the mean reflectance of the bare surface at the camera's wavelength; its texture is taken from the pictures.
///
/// # Errors
/// Mosaics or a list of other lengths, a ground outside its range, a paint with numbers that are not finite or negative, too few bare texels
/// that were seen.
pub fn estimate_film(
    before: &Mosaic,
    after: &Mosaic,
    bare: Option<&[bool]>,
    paint: &GreyPaint,
    ground: f64,
) -> Result<Vec<Option<FilmEstimate>>, Error> {
    let texels = before.texels();
    let listed = bare.map_or(texels.len(), <[bool]>::len);
    for (what, length) in [("texels of the mosaic after", after.texels().len()), ("list of bare texels", listed)] {
        if length != texels.len() {
            return Err(Error::WrongLength { what, expected: texels.len(), found: length });
        }
    }
    check_range("reflectance of the ground", ground, GROUND[0], GROUND[1], "between 0.005 and 0.98")?;
    check_range("scattering of a paint", paint.scattering, 0.0, f64::MAX, "finite and not negative")?;
    check_positive("absorption of a paint", paint.absorption)?;

    let seen: Vec<Option<[TexelLight; 2]>> =
        before.light().into_iter().zip(after.light()).map(|(a, b)| Some([a?, b?])).collect();
    let fit = |what, value: &dyn Fn(&[TexelLight; 2]) -> f64, wanted: &dyn Fn(usize) -> bool| {
        let observed: Vec<(&Texel, f64)> = (0..texels.len())
            .filter(|&k| wanted(k))
            .filter_map(|k| Some((&texels[k], value(seen[k].as_ref()?))))
            .collect();
        Lighting::fit(texels, &observed).ok_or(Error::WrongLength {
            what,
            expected: Lighting::LEAST,
            found: observed.len(),
        })
    };
    let scene = fit("texels that both mosaics show", &|[before, _]| before.log, &|_| true)?;
    let change = bare
        .map(|bare| fit("bare texels that both mosaics show", &|[before, after]| after.log - before.log, &|k| bare[k]))
        .transpose()?;
    // Against the mean of the surface; a fit of logarithms is below it where the ground is mottled.
    let against_scene = |k: usize| Some((seen[k]?[0].log - scene.log(&texels[k])).exp());
    let mottles: Vec<f64> = (0..texels.len()).filter_map(against_scene).collect();
    let mean = mottles.iter().sum::<f64>() / mottles.len() as f64;
    let film = |k: usize| {
        let [before, after] = seen[k].as_ref()?;
        let ground = (ground * against_scene(k)? / mean).clamp(GROUND[0], GROUND[1]);
        let light = change.as_ref().map_or(0.0, |change| change.log(&texels[k]));
        let ratio = (after.log - before.log - light).exp();
        let sigma = ground * ratio * before.sigma.hypot(after.sigma);
        film_of(paint, ground, ground * ratio, sigma)
    };
    Ok((0..texels.len()).map(film).collect())
}

/// The film that turns a ground's reflectance into another; `None` where paint and ground look the same.
fn film_of(paint: &GreyPaint, ground: f64, reflectance: f64, sigma: f64) -> Option<FilmEstimate> {
    let GreyPaint { absorption, scattering } = *paint;
    let opaque = paint.reflectance(THICKEST, ground);
    if (opaque - ground).abs() < LEAST_CONTRAST {
        return None;
    }
    // Falls or rises from the ground's to the opaque paint's.
    let beyond =
        |thickness: f64| (paint.reflectance(thickness, ground) - reflectance) * (opaque - ground).signum() > 0.0;
    let (mut thin, mut thick) = (0.0, THICKEST);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (thin + thick);
        if beyond(middle) {
            thick = middle;
        } else {
            thin = middle;
        }
    }
    let is_opaque = (reflectance - opaque) * (ground - opaque).signum() < OPAQUE * sigma;
    // The thickness from which on it looks opaque.
    if is_opaque {
        let almost = opaque + OPAQUE * sigma * (ground - opaque).signum();
        let least = film_of(paint, ground, almost, 0.0).filter(|film| !film.opaque).map_or(thin, |film| film.thickness);
        return Some(FilmEstimate { thickness: least, sigma: least, opaque: true });
    }
    let slope = km::gradient(absorption, scattering, thin, ground).thickness.abs();
    Some(FilmEstimate { thickness: thin, sigma: sigma / slope.max(f64::MIN_POSITIVE), opaque: false })
}
