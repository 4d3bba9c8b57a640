//! Where the person stands who watches: behind the camera, or so far before what the robot flies at that all of it is seen.

use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};

/// How far behind it, and how much higher, m.
const BEHIND: f64 = 1.0;
const ABOVE: f64 = 0.3;
/// Half of the smaller angle of the page's view, rad.
const HALF_VIEW: f64 = 0.54;
/// A scene whose up is less than this part of the page's up lies on its side.
const UPRIGHT: f64 = 0.5;
/// Height of the person's eyes above the page's ground, m, where the scene itself does not say.
const EYES: f64 = 1.7;
/// Lowest place of the eyes, m.
const LOWEST: f64 = 0.5;

/// Where the scene and the person are on the page, whose z is up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    pub(super) page_from_scene: Isometry3<f64>,
    pub(super) eyes: Point3<f64>,
    pub(super) heading: f64,
}

/// Looks where the frame looks: along z of a camera (`optical`, y down), along x of a body (z up). A scene that is not upright is turned
/// so that the frame is. `bounds`: lowest and highest corner of what stands before a body.
pub(super) fn place(scene_from_frame: &Isometry3<f64>, optical: bool, bounds: Option<[Point3<f64>; 2]>) -> Place {
    let (ahead, up) = if optical { (Vector3::z(), -Vector3::y()) } else { (Vector3::x(), Vector3::z()) };
    let (ahead, up) = (scene_from_frame.rotation * ahead, scene_from_frame.rotation * up);
    let turn = if up.z >= UPRIGHT {
        UnitQuaternion::identity()
    } else {
        // Half a turn has no axis of its own.
        let turn = Rotation3::rotation_between(&up, &Vector3::z());
        turn.map_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI), Into::into)
    };
    let ahead = turn * ahead;
    let heading = ahead.y.atan2(ahead.x);
    let level = Vector3::new(heading.cos(), heading.sin(), 0.0);
    let frame = turn * scene_from_frame.translation.vector;
    let behind = frame - level * BEHIND + Vector3::z() * ABOVE;
    let eyes = bounds.filter(|_| !optical).map_or(behind, |[low, high]| {
        let (middle, radius) = (turn * nalgebra::center(&low, &high), 0.5 * (high - low).norm());
        let away = (radius / HALF_VIEW.sin()).max(level.dot(&(middle.coords - behind)));
        middle.coords - level * away
    });
    let lift = if turn == UnitQuaternion::identity() && eyes.z >= LOWEST { 0.0 } else { EYES - eyes.z };
    let lift = Vector3::z() * lift;
    Place { page_from_scene: Isometry3::from_parts(lift.into(), turn), eyes: (eyes + lift).into(), heading }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_on_its_side_is_set_upright_and_looked_at() {
        // The world of a depth camera: z ahead, y down.
        let at = place(&Isometry3::translation(0.2, 0.0, 0.0), true, None);
        let wall = at.page_from_scene * Point3::new(0.2, 0.0, 1.5);
        let ahead = Vector3::new(at.heading.cos(), at.heading.sin(), 0.0);
        let way = wall - at.eyes;
        assert!((way.dot(&ahead) - 2.5).abs() < 1e-12 && (way.z + 0.3).abs() < 1e-12, "{way}");
        assert!((at.eyes.z - EYES).abs() < 1e-12);
        // Above in the camera's picture is above on the page.
        let above = at.page_from_scene * Vector3::new(0.0, -1.0, 0.0);
        assert!((above - Vector3::z()).norm() < 1e-12, "{above}");
    }

    #[test]
    fn an_upright_scene_stays_as_it_is() {
        let body = Isometry3::new(Vector3::new(-1.0, 2.0, 1.5), Vector3::z() * 0.4);
        let at = place(&body, false, None);
        assert_eq!(at.page_from_scene, Isometry3::identity());
        assert!((at.heading - 0.4).abs() < 1e-12);
        let eyes = Point3::new(-1.0 - 0.4_f64.cos(), 2.0 - 0.4_f64.sin(), 1.8);
        assert!((at.eyes - eyes).norm() < 1e-12);
        let down = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
        assert!((place(&down, false, None).page_from_scene * (down * Vector3::z()) - Vector3::z()).norm() < 1e-9);
    }

    #[test]
    fn all_of_a_wall_is_before_the_eyes() {
        let body = Isometry3::translation(-1.0, 2.5, 0.4);
        let (low, high) = (Point3::new(0.0, -3.0, 1.0), Point3::new(0.2, 3.0, 3.0));
        let at = place(&body, false, Some([low, high]));
        assert_eq!((at.page_from_scene, at.heading), (Isometry3::identity(), 0.0));
        for [x, y, z] in [[0.0, -3.0, 1.0], [0.2, 3.0, 3.0], [0.0, 3.0, 1.0], [0.2, -3.0, 3.0]] {
            let way = Point3::new(x, y, z) - at.eyes;
            assert!(way.x > 1.0 && way.angle(&Vector3::x()) < HALF_VIEW, "{way}");
        }
        // What is small is looked at from behind the robot all the same.
        let at = place(&body, false, Some([Point3::new(0.0, 2.4, 1.6), Point3::new(0.1, 2.6, 1.8)]));
        assert!(at.eyes.x < -1.99 && (at.eyes.y - 2.5).abs() < 1e-9);
    }
}
