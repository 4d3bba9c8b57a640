//! Colours of stacks of films: within what the eye sees of the closed form in double precision.

use paint_sim::colour::{ciede2000, encode_srgb8, linear_srgb_lab, spectrum_linear_srgb};
use paint_sim::paint::{FilmColours, GpuFilmColours, PIGMENTS, PaintName};
use paint_sim::surface::GpuOptions;
use paint_sim::{Paint, Substrate};

use super::{available, options, random};

const FILM: f64 = 20e-6;
const PLACES: usize = 400;

/// All paints that are shipped, and those at the ends of the formula.
fn paints() -> Vec<Paint> {
    let flat = |k: f64, s: f64| Paint::new(&[k; 36], &[s; 36], FILM).unwrap();
    let named = PaintName::ALL.into_iter().map(|name| name.paint(FILM).unwrap());
    let pigments = PIGMENTS.iter().map(|pigment| pigment.paint(FILM).unwrap());
    named
        .chain(pigments)
        .chain([flat(0.0, 1e-9), flat(0.0, 3.0), flat(3.0, 0.0), flat(0.0, 0.0), flat(40.0, 30.0)])
        .collect()
}

/// Bare, hardly there, usual, and far beyond opaque.
fn thickness(place: u64) -> f32 {
    let part = random(2 * place + 1);
    match (4.0 * random(2 * place)) as u32 {
        0 => 0.0,
        1 => (1e-4 * FILM * part) as f32,
        2 => (4.0 * FILM * part) as f32,
        _ => (FILM * 10.0_f64.powf(2.0 + 4.0 * part)) as f32,
    }
}

/// The films one by one, in double precision.
fn closed_form(paints: &[Paint], ground: &Substrate, thickness: &[f32], place: usize, places: usize) -> [f64; 3] {
    let mut top = *ground;
    for (film, paint) in paints.iter().enumerate() {
        top = paint.over(f64::from(thickness[film * places + place]), &top).unwrap();
    }
    spectrum_linear_srgb(top.reflectance())
}

#[test]
fn stacks_have_the_colours_of_the_closed_form() {
    let all = paints();
    let grounds = [Substrate::grey(0.0).unwrap(), Substrate::grey(1.0).unwrap(), Substrate::sandstone()];
    let (mut worst, mut processor, mut codes) = ([0.0_f64; 2], [0.0_f64; 2], 0);
    for round in 0..60_u64 {
        let ground = &grounds[round as usize % grounds.len()];
        let pick = |film: u64| all[(random(1000 * round + film) * all.len() as f64) as usize];
        let stack: Vec<Paint> =
            if (round as usize) < all.len() { vec![all[round as usize]] } else { (0..=round % 12).map(pick).collect() };
        let films = FilmColours::stacked(&stack, ground);
        let Some(gpu) = available(GpuFilmColours::new(&films, &options())) else { return };
        let depths: Vec<f32> = (0..stack.len() * PLACES).map(|k| thickness(100_000 * round + k as u64)).collect();
        let (mut found, mut own, mut coded) = (vec![[0.0; 3]; PLACES], vec![[0.0; 3]; PLACES], vec![[0; 3]; PLACES]);
        gpu.linear_srgb(&depths, &mut found).unwrap();
        films.linear_srgb(&depths, &mut own).unwrap();
        gpu.srgb8(&depths, &mut coded).unwrap();
        for place in 0..PLACES {
            let expected = closed_form(&stack, ground, &depths, place, PLACES);
            for (linear, worst) in [(found[place], &mut worst), (own[place], &mut processor)] {
                let difference = ciede2000(linear_srgb_lab(linear.map(f64::from)), linear_srgb_lab(expected));
                let far = (0..3).map(|c| (f64::from(linear[c]) - expected[c]).abs()).fold(0.0, f64::max);
                *worst = [worst[0].max(difference), worst[1].max(far)];
            }
            for c in 0..3 {
                assert_eq!(coded[place][c], encode_srgb8(f64::from(found[place][c])).0, "{round} {place}");
                codes += usize::from(coded[place][c] > 0 && coded[place][c] < 255);
            }
        }
    }
    println!("GPU {worst:?}, processor {processor:?}: CIEDE2000, linear sRGB");
    assert!(worst[0] <= 0.01 && worst[1] < 2e-6, "{worst:?}");
    assert!(processor[0] <= 0.01 && processor[1] < 2e-6, "{processor:?}");
    assert!(codes > 10_000, "{codes}");
}

#[test]
fn odd_thicknesses_are_none_and_wrong_numbers_are_refused() {
    let films = FilmColours::new(&Paint::yellow(FILM).unwrap(), &Substrate::grey(0.3).unwrap());
    let Some(gpu) = available(GpuFilmColours::new(&films, &options())) else { return };
    let (mut odd, mut bare) = ([[0; 3]; 5], [[0; 3]; 2]);
    gpu.srgb8(&[f32::NAN, -1.0, f32::NEG_INFINITY, -0.0, f32::INFINITY], &mut odd).unwrap();
    gpu.srgb8(&[0.0, 1.0], &mut bare).unwrap();
    assert_eq!(odd, [bare[0], bare[0], bare[0], bare[0], bare[1]]);
    assert!(gpu.srgb8(&[0.0], &mut odd).unwrap_err().to_string().contains("thicknesses"));
    gpu.srgb8(&[], &mut []).unwrap();
    let none = GpuFilmColours::new(&FilmColours::stacked(&[], &Substrate::grey(0.3).unwrap()), &options()).unwrap();
    none.srgb8(&[], &mut bare).unwrap();
    assert_eq!(bare, [odd[0]; 2]);
    assert!(!gpu.name().is_empty());
}

/// More places than one buffer of the adapter takes are done in parts.
#[test]
fn large_work_is_done_in_parts() {
    let paints = [Paint::yellow(FILM).unwrap(), Paint::blue(FILM).unwrap()];
    let films = FilmColours::stacked(&paints, &Substrate::sandstone());
    let Some(whole) = available(GpuFilmColours::new(&films, &options())) else { return };
    let small = GpuOptions { max_buffer_bytes: 3000, ..options() };
    let parts = GpuFilmColours::new(&films, &small).unwrap();
    let depths: Vec<f32> = (0..2000).map(thickness).collect();
    let (mut at_once, mut in_parts) = (vec![[0.0; 3]; 1000], vec![[0.0; 3]; 1000]);
    whole.linear_srgb(&depths, &mut at_once).unwrap();
    parts.linear_srgb(&depths, &mut in_parts).unwrap();
    assert_eq!(at_once, in_parts);
    let tiny = GpuOptions { max_buffer_bytes: 100, ..options() };
    let refused = GpuFilmColours::new(&films, &tiny).err().unwrap().to_string();
    assert!(refused.contains("offers 100 at once"), "{refused}");
}
