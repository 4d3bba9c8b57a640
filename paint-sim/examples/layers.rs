//! Layers of paint by Kubelka-Munk theory: what yellow over blue, blue over yellow and their wet mixture look like as they get thicker.

use paint_sim::{Error, Paint, Substrate, colour};

/// CIELAB of a coat of the second paint over one of the first, both of this thickness in metres, on light grey.
pub(crate) fn coats(first: &Paint, second: &Paint, thickness: f64) -> Result<[f64; 3], Error> {
    let ground = Substrate::grey(0.8)?;
    let coat = second.over(thickness, &first.over(thickness, &ground)?)?;
    Ok(colour::spectrum_lab(coat.reflectance()))
}

fn main() -> Result<(), Error> {
    let (yellow, blue) = (Paint::yellow(50e-6)?, Paint::blue(50e-6)?);
    let green = Paint::mix(&[(yellow, 1.0), (blue, 1.0)])?;
    println!("  film   yellow, then blue      blue, then yellow      mixed (L* a* b*)");
    for thickness in [5e-6, 10e-6, 20e-6, 50e-6, 100e-6, 200e-6] {
        let films =
            [coats(&yellow, &blue, thickness)?, coats(&blue, &yellow, thickness)?, coats(&green, &green, thickness)?];
        let text = films.map(|[l, a, b]| format!("{l:6.1} {a:6.1} {b:6.1}"));
        println!("{:4.0} um   {}", 1e6 * thickness, text.join("   "));
    }
    Ok(())
}
