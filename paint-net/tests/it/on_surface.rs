//! A surface that the plane shows only roughly.

use paint_net::painters::{Centrelines, SurfaceFootprint};
use paint_net::path::Stroke;
use paint_net::procedural::Texture;
use paint_net::{
    Deconvolution, Error, Feedback, Image, Limits, OnSurface, PaintProblem, Painter, Painting, Spray, SprayKernel,
    metrics,
};

const SIDE: usize = 64;

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 4.0).unwrap()
}

/// A sheet that is stretched from left to right, and stands up along a column so that nothing from the left falls behind it. The last columns
/// are a hole.
fn footprint(spray: &Spray) -> SurfaceFootprint {
    let stretch = 0.8 + 0.45 * spray.x / SIDE as f64;
    let at = |k: usize| {
        let (x, y) = ((k % SIDE) as f64, (k / SIDE) as f64);
        let hidden = spray.x < 20.0 && (20.0..23.0).contains(&x);
        let squared = ((x - spray.x) * stretch).powi(2) + (y - spray.y).powi(2);
        (!hidden && squared < 64.0).then(|| (k as u32, (-squared / 8.0).exp() as f32))
    };
    if spray.x >= 60.0 { Vec::new() } else { (0..SIDE * SIDE).filter_map(at).collect() }
}

fn footprints(strokes: &[Stroke]) -> Vec<SurfaceFootprint> {
    strokes.iter().flat_map(|stroke| &stroke.sprays).map(footprint).collect()
}

/// What lands.
fn sheet(painting: &Painting, before: f64) -> Image {
    let mut canvas = Image::filled(SIDE, SIDE, before);
    for spray in &painting.sprays {
        for (k, depth) in footprint(spray) {
            canvas.data_mut()[k as usize] += spray.volume * f64::from(depth);
        }
    }
    canvas
}

#[test]
fn volumes_are_those_for_what_lands_on_the_surface() {
    let (wanted, kernel, before) = (Texture::Fbm.image(4, SIDE), nozzle(), Image::filled(SIDE, SIDE, 0.02));
    let limits = Limits { spray_spacing: 2, row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits).with_canvas(&before);
    let seen = Image::from_fn(SIDE, SIDE, |x, _| f64::from(u8::from(x < 56)));
    let quality = |canvas: &Image| metrics::psnr(&canvas.map(f64::tanh), &wanted, Some(&seen)).unwrap();
    let feedback = Feedback::shipped().unwrap();
    let painters: [&dyn Painter; 3] = [&Deconvolution::default(), &feedback, &Centrelines::default()];
    for inner in painters {
        let (flat, fitted) =
            (inner.paint(&problem).unwrap(), OnSurface::new(inner, &footprints).paint(&problem).unwrap());
        let landed = sheet(&fitted, 0.02);
        let off = landed.data().iter().zip(fitted.canvas.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{}: expects another wall, {off}", inner.name());
        let (best, got) = (quality(&landed), quality(&sheet(&flat, 0.02)));
        assert!(best > got + 2.0, "{}: {best} dB, {got} dB by the plan on the plane", inner.name());
        assert!(fitted.sprays.iter().all(|s| s.x < 60.0 && s.volume >= 0.01 && s.volume <= limits.max_volume));
        let along: Vec<Spray> = fitted.strokes.iter().flat_map(|stroke| stroke.sprays.clone()).collect();
        assert!(flat.strokes.is_empty() == along.is_empty() && (along.is_empty() || along == fitted.sprays));
    }
}

/// A dark wall asks for more than the valve gives: no spray is larger for it.
#[test]
fn no_spray_on_a_surface_is_larger_than_the_largest() {
    let (wanted, kernel) = (Image::filled(SIDE, SIDE, 0.9), nozzle());
    let limits = Limits { spray_spacing: 2, row_spacing: 3, min_volume: 0.02, max_volume: 0.1, ..Limits::default() };
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits);
    let painting = OnSurface::new(Deconvolution::default(), &footprints).paint(&problem).unwrap();
    let largest = painting.sprays.iter().map(|spray| spray.volume).fold(0.0, f64::max);
    assert!((largest - 0.1).abs() < 1e-12, "{largest}");
}

#[test]
fn footprints_that_cannot_be_are_refused() {
    let wanted = Image::filled(SIDE, SIDE, 0.3);
    let refused = |spoil: &dyn Fn(&mut Vec<SurfaceFootprint>)| {
        let spoilt = |strokes: &[Stroke]| {
            let mut all = footprints(strokes);
            spoil(&mut all);
            all
        };
        OnSurface::new(Deconvolution::default(), &spoilt).paint(&PaintProblem::new(&wanted))
    };
    assert!(refused(&|_| ()).is_ok());
    assert!(matches!(refused(&|all| drop(all.pop())), Err(Error::Mismatch { .. })));
    assert!(matches!(refused(&|all| all[7][0].0 = (SIDE * SIDE) as u32), Err(Error::Pixel { .. })));
    assert!(matches!(refused(&|all| all[7][0].1 = f32::NAN), Err(Error::Pixel { .. })));
    assert!(matches!(refused(&|all| all[7][0].1 = -1.0), Err(Error::Pixel { .. })));
}
