//! A cone as a program on a GPU takes it.

use super::Cone;

/// Numbers of a cone.
pub(crate) const CONE_NUMBERS: usize = 36;

/// All that [`Cone::may_intersect`] and the density of [`Cone::slope_forms`] compute with, as `film/share.wgsl` names them: origin, three forms,
/// centre, most, range, scale, deviation, slope, secant, and both sides of an ellipse.
pub(crate) fn cone_numbers(cone: &Cone) -> [f64; CONE_NUMBERS] {
    let forms = cone.slope_forms();
    let mut numbers = [0.0; CONE_NUMBERS];
    let rest = [forms.most, forms.range, forms.scale, cone.deviation, cone.slope, cone.secant];
    let vectors = cone.origin.coords.iter().chain(forms.forms.iter().flat_map(|form| form.iter()));
    let sides = cone.elliptic.as_ref().map(super::ellipse::EllipticCone::sides);
    // What is not zero says that there are sides.
    let elliptic = sides.iter().flatten().flatten().chain(sides.iter().map(|_| &1.0));
    for (number, value) in numbers.iter_mut().zip(vectors.chain(&forms.center).chain(&rest).chain(elliptic)) {
        *number = *value;
    }
    numbers
}
