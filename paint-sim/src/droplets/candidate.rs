//! A face as the nozzle sees it.

use nalgebra::{Matrix3, Vector3};

use super::texel_surface::Face;

/// Linear forms of a face over the slopes `(x, y)` of a ray `d = (x, y, 1)` from the nozzle.
///
/// With the corners `a, b, c` relative to the nozzle, `d . (b x c)`, `d . (c x a)` and `d . (a x b)` have one sign where the ray meets
/// the face, and their shares of their sum are its barycentric weights there. Cross products are exactly antisymmetric, so two faces
/// that share an edge leave no gap.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// The three edge forms.
    pub(super) edges: [[f32; 3]; 3],
    /// Their sum: along the normal of the face, twice its area long.
    pub(super) sum: [f32; 3],
    /// Determinant of the corners: `sum . d` over it is one over the depth. Its sign tells the side of the face.
    pub(super) determinant: f32,
    /// Distance of the nozzle from the plane of the face, m.
    pub(super) height: f32,
    /// Column and row of the texture, times `sum . d`.
    pub(super) texel: [[f32; 3]; 2],
    /// Whether paint that lands here lands on a texel: the face has some, and the nozzle is on its painted side.
    pub(super) painted: bool,
    /// Box of the slopes under which the face is seen.
    pub(super) low: [f32; 2],
    pub(super) high: [f32; 2],
}

impl Candidate {
    /// `None` where the nozzle lies in the plane of the face.
    pub(super) fn new(face: &Face, nozzle_from_world: &Matrix3<f64>, origin: &Vector3<f64>) -> Option<Self> {
        let [a, b, c] = face.corners.map(|corner| (nozzle_from_world * (corner - origin)).cast::<f32>());
        let edges = [b.cross(&c), c.cross(&a), a.cross(&b)];
        let sum = edges[0] + edges[1] + edges[2];
        let determinant = a.dot(&edges[0]);
        if !(1.0 / determinant).is_finite() {
            return None;
        }
        let places = face.texels.unwrap_or_default();
        let texel =
            [0, 1].map(|k| (edges[0] * places[0][k] + edges[1] * places[1][k] + edges[2] * places[2][k]).into());
        // Slopes say nothing where a corner is beside or behind the nozzle.
        let ahead = a.z.min(b.z).min(c.z) > 1e-6;
        let bound = |k: usize, pick: fn(f32, f32) -> f32| pick(pick(a[k] / a.z, b[k] / b.z), c[k] / c.z);
        // The margin outweighs the rounding of the quotients.
        let margin = 1e-6;
        let low = [0, 1].map(|k| if ahead { bound(k, f32::min) - margin } else { f32::NEG_INFINITY });
        let high = [0, 1].map(|k| if ahead { bound(k, f32::max) + margin } else { f32::INFINITY });
        Some(Self {
            edges: edges.map(Into::into),
            sum: sum.into(),
            determinant,
            height: determinant.abs() / sum.norm(),
            texel,
            painted: face.texels.is_some() && determinant < 0.0,
            low,
            high,
        })
    }
}

/// The form's value for the ray with these slopes.
#[inline(always)]
pub(super) fn value(form: &[f32; 3], x: f32, y: f32) -> f32 {
    form[0] * x + form[1] * y + form[2]
}
