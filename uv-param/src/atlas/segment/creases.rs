//! The first charts of what has edges: the faces between its creases. A machine part or a building falls into its sides this way.

use crate::polygon_soup::find_root;
use crate::surface::Surface;

/// Bend of a crease, radians: 30 degrees.
const CREASE: f64 = std::f64::consts::FRAC_PI_6;
/// Least faces of a side on average: what has as many creases as faces is rough, not made of sides.
const LEAST_FACES: usize = 8;

/// A region number for every face, creases and `barrier` between them; `None` for a surface that is not made of sides.
pub(in crate::atlas) fn sides_between_creases(surface: &Surface, barrier: &[bool]) -> Option<Vec<u32>> {
    let faces = surface.faces().len();
    let mut root: Vec<u32> = (0..faces as u32).collect();
    for h in (0..3 * faces).filter(|&h| !barrier[h]) {
        let Some(twin) = surface.twin(h).filter(|twin| h < *twin) else { continue };
        let (left, right) = (surface.face_cross(h / 3), surface.face_cross(twin / 3));
        if left.cross(&right).norm().atan2(left.dot(&right)) < CREASE {
            let [a, b] = [h / 3, twin / 3].map(|f| find_root(&mut root, f as u32));
            root[a.max(b) as usize] = a.min(b);
        }
    }
    let mut numbers = vec![u32::MAX; faces];
    let mut count = 0;
    let region = (0..faces as u32)
        .map(|f| {
            let number = &mut numbers[find_root(&mut root, f) as usize];
            if *number == u32::MAX {
                *number = count;
                count += 1;
            }
            *number
        })
        .collect();
    (count > 1 && LEAST_FACES * count as usize <= faces).then_some(region)
}
