//! What a pair of cameras measures, against closed forms.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix2, UnitQuaternion, Vector2, Vector3, Vector4};

use super::epipolar_search::StereoDepth;
use super::rig::StereoRig;
use super::stereo_camera::StereoCamera;
use crate::camera::{Camera, Distortion};
use crate::filter::frontend::patch::{LEVELS, Patch};
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::measurements::measurement::{Measurement, Trial};
use crate::filter::measurements::stereo_pixel::StereoPixelMeasurement;
use crate::filter::settings::Settings;
use crate::filter::state::bearing::Bearing;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::{Landmark, project};
use crate::filter::state::vio_state::VioState;
use crate::inertial::iterated_update::Linearization;
use crate::samples::ImageView;
use crate::sim::Rng;

const WIDTH: usize = 200;
const HEIGHT: usize = 140;
/// Distance of the wall that both cameras see, along the first one's axis.
const AWAY: f64 = 2.5;

/// Two pinholes 0.12 m apart, the second turned a little.
fn cameras() -> [Camera; 2] {
    let camera = |body_from_camera| Camera {
        width: WIDTH,
        height: HEIGHT,
        fx: 130.0,
        fy: 128.0,
        cx: 99.0,
        cy: 71.0,
        distortion: Distortion::None,
        body_from_camera,
    };
    let first = Isometry3::translation(0.1, 0.2, 0.0);
    let turn = UnitQuaternion::from_euler_angles(0.01, -0.02, 0.03);
    [camera(first), camera(first * Isometry3::from_parts(Vector3::new(0.12, 0.0, 0.0).into(), turn))]
}

/// Structure in all directions, the same nowhere twice within a metre; x and y in pixels of the first camera.
fn irregular(x: f64, y: f64) -> f64 {
    let waves = [(0.33, 0.15, 0.3), (-0.12, 0.39, 1.9), (0.27, -0.3, 4.0), (0.19, 0.11, 0.7), (0.083, 0.021, 2.0)];
    waves.iter().map(|(a, b, c)| 22.0 * (a * x + b * y + c).sin()).sum()
}

/// The same every twelve pixels from left to right.
fn regular(x: f64, y: f64) -> f64 {
    40.0 * (x * std::f64::consts::TAU / 12.0).sin() + 40.0 * (0.4 * y).sin()
}

/// The wall as a camera sees it.
fn picture(camera: &Camera, look: &impl Fn(f64, f64) -> f64, gain: f64, noise: &mut impl FnMut() -> f64) -> Pyramid {
    let first = cameras()[0];
    let from_camera = first.body_from_camera.inverse() * camera.body_from_camera;
    let data: Vec<u8> = (0..WIDTH * HEIGHT)
        .map(|k| {
            let pixel = Vector2::new((k % WIDTH) as f64, (k / WIDTH) as f64);
            let ray = from_camera.rotation * camera.bearing(&pixel).unwrap().into_inner();
            let start = from_camera.translation.vector;
            let at = first.project(&(start + ray * ((AWAY - start.z) / ray.z))).unwrap();
            (120.0 + gain * look(at.x, at.y) + noise()).round().clamp(0.0, 255.0) as u8
        })
        .collect();
    let mut pyramid = Pyramid::new(WIDTH, HEIGHT, 0, LEVELS);
    pyramid.fill(&ImageView { width: WIDTH, height: HEIGHT, data: &data });
    pyramid
}

/// What the pair says about the patches around some pixels, with the truth.
fn measured(
    look: impl Fn(f64, f64) -> f64,
    gain: f64,
    mut noise: impl FnMut() -> f64,
    range: impl Fn(f64) -> (f64, f64),
    settings: &Settings,
) -> Vec<(Option<StereoDepth>, f64)> {
    let [camera, other] = cameras();
    let first = picture(&camera, &look, 1.0, &mut noise);
    let mut second = StereoCamera::new(&camera, Arc::new(other), &settings.patches).unwrap();
    second.set_pyramid(picture(&other, &look, gain, &mut noise));
    let mut found = Vec::new();
    for y in 0..4 {
        for x in 0..6 {
            let pixel = Vector2::new(50.0 + 22.3 * f64::from(x), 30.0 + 26.7 * f64::from(y));
            let patch = Patch::extract(&first, &pixel).unwrap();
            let bearing = Bearing::new(&camera.bearing(&pixel).unwrap());
            let warp = project(&camera, &bearing).unwrap().1.try_inverse().unwrap();
            let truth = bearing.direction().z / AWAY;
            let there = Landmark::new(bearing, InverseDistance::new(1.0), warp);
            found.push((second.measure(&patch, &there, range(truth), settings), truth));
        }
    }
    found
}

fn wide(_: f64) -> (f64, f64) {
    (0.0, 2.0)
}

/// Twelve uniform numbers summed up to a normal distribution.
fn normal(rng: &mut Rng) -> f64 {
    (0..12).map(|_| rng.uniform()).sum::<f64>() - 6.0
}

#[test]
fn a_landmark_is_where_the_other_camera_sees_its_point() {
    let [first, other] = [Camera::euroc(), Camera::euroc_right()];
    let rig = StereoRig::new(&first, Arc::new(other));
    for k in 0..60 {
        let pixel = Vector2::new(120.0 + 9.0 * f64::from(k), 60.0 + 67.0 * f64::from(k % 6));
        let bearing = Bearing::new(&first.bearing(&pixel).unwrap());
        let landmark = |near| Landmark::new(bearing, InverseDistance::new(near), Matrix2::new(1.1, 0.2, -0.3, 0.9));
        let near = 0.1 + 0.02 * f64::from(k);
        let (at, landmark) = (landmark, landmark(near));
        let seen = |landmark: &Landmark| {
            let point = landmark.bearing.direction() / landmark.inverse_distance.value;
            let in_body = first.body_from_camera * nalgebra::Point3::from(point);
            other.project(&(other.body_from_camera.inverse() * in_body).coords).unwrap()
        };
        let place = rig.project(&landmark).unwrap();
        assert!((place.pixel - seen(&landmark)).norm() < 1e-9);
        // Derivatives by differences of the same projection.
        let h = 1e-6;
        let [nearer, farther] = [h, -h].map(|h| seen(&at(near + h)));
        assert!(
            ((nearer - farther) / (2.0 * h) - place.by_inverse_distance).norm() < 1e-4,
            "{}",
            place.by_inverse_distance
        );
        for axis in 0..2 {
            let step = landmark.warp.column(axis) * h;
            let [one, two] = [step, -step].map(|step| seen(&Landmark { bearing: bearing.boxplus(&step), ..landmark }));
            assert!(((one - two) / (2.0 * h) - place.warp.column(axis)).norm() < 1e-4 * place.warp.norm());
        }
    }
}

/// Whatever pixels a patch of it has: the other camera sees the same plane.
#[test]
fn a_surface_stays_turned_when_its_patch_is_extracted_again() {
    let [first, other] = [Camera::euroc(), Camera::euroc_right()];
    let rig = StereoRig::new(&first, Arc::new(other));
    let mut landmark = Landmark::new(
        Bearing::new(&first.bearing(&Vector2::new(300.0, 190.0)).unwrap()),
        InverseDistance::new(0.6),
        Matrix2::new(1.1, 0.2, -0.3, 0.9) / 458.0,
    );
    landmark.slope = Vector2::new(9e-4, -4e-4);
    let warp = Matrix2::new(0.8, -0.4, 0.1, 1.2) / 458.0;
    let again = landmark.extracted_again(warp).unwrap();
    let new_by_old = warp.try_inverse().unwrap() * landmark.warp;
    let [old, new] = [landmark, again].map(|landmark| rig.project(&landmark).unwrap().warp);
    assert!((old - new * new_by_old).norm() < 1e-12 * old.norm(), "{old} {new}");
    let facing = rig.project(&Landmark { slope: Vector2::zeros(), ..again }).unwrap().warp;
    assert!((facing - new).norm() > 1e-2 * new.norm(), "the slope shows");
}

#[test]
fn distances_are_found_without_any_idea_of_them() {
    // The second camera may be set to another exposure.
    for gain in [1.0, 0.6] {
        let found = measured(irregular, gain, || 0.0, wide, &Settings::default());
        let right = found.iter().filter(|(depth, truth)| {
            depth.is_some_and(|depth| {
                let off = depth.inverse_distance - truth;
                assert!(off.abs() < 3.0 * depth.variance.sqrt() && off.abs() < 0.03 * truth, "{off} of {truth}");
                true
            })
        });
        assert!(right.count() >= 20, "{found:?}");
    }
}

#[test]
fn the_claim_is_that_of_the_noise() {
    let mut settings = Settings::default();
    // Nothing but noise here.
    settings.stereo.pixel_sigma = 1e-3;
    let (mut sum, mut count, mut rng) = (0.0, 0.0, Rng::new(3));
    for _ in 0..8 {
        for (depth, truth) in measured(irregular, 1.0, || 2.0 * normal(&mut rng), wide, &settings) {
            let Some(depth) = depth else { continue };
            sum += (depth.inverse_distance - truth).powi(2) / depth.variance;
            count += 1.0;
        }
    }
    // The coarser level has less noise than it is taken to have, and `grey_sigma` is a floor: a little below 1.
    assert!(count > 150.0 && (0.4..1.2).contains(&(sum / count)), "{} of {count}", sum / count);
}

#[test]
fn what_looks_the_same_elsewhere_is_not_taken() {
    let right = |(depth, truth): &&(Option<StereoDepth>, f64)| {
        depth.is_some_and(|depth| (depth.inverse_distance - truth).abs() < 0.03 * truth)
    };
    // Twelve pixels are 0.8 1/m here. Towards the border the deformation of the patch gives the right place away.
    let found = measured(regular, 1.0, || 0.0, wide, &Settings::default());
    let taken = found.iter().filter(|(depth, _)| depth.is_some()).count();
    assert!(taken <= 4 && found.iter().filter(right).count() == taken, "{found:?}");
    // If it is known well enough where to look there is only one.
    let found = measured(regular, 1.0, || 0.0, |truth| (truth - 0.15, truth + 0.1), &Settings::default());
    assert!(found.iter().filter(right).count() >= 20, "{found:?}");
}

#[test]
fn nothing_is_found_where_it_is_not() {
    // The wall is nearer than the places that are searched.
    let found = measured(irregular, 1.0, || 0.0, |truth| (0.0, 0.3 * truth), &Settings::default());
    assert!(found.iter().filter(|(depth, _)| depth.is_some()).count() <= 1, "{found:?}");
    // Without an image nothing is measured.
    let [camera, other] = cameras();
    let settings = Settings::default();
    let first = picture(&camera, &irregular, 1.0, &mut || 0.0);
    let second = StereoCamera::new(&camera, Arc::new(other), &settings.patches).unwrap();
    let pixel = Vector2::new(80.0, 60.0);
    let bearing = Bearing::new(&camera.bearing(&pixel).unwrap());
    let warp = project(&camera, &bearing).unwrap().1.try_inverse().unwrap();
    let patch = Patch::extract(&first, &pixel).unwrap();
    let there = Landmark::new(bearing, InverseDistance::new(1.0), warp);
    assert!(second.measure(&patch, &there, wide(0.0), &settings).is_none());
}

#[test]
fn pixels_of_the_second_camera_move_with_bearing_distance_and_clock() {
    let [first, other] = [Camera::euroc(), Camera::euroc_right()];
    let rig = StereoRig::new(&first, Arc::new(other));
    let (rate, mut settings, state) = (Vector2::new(0.3, -0.5), Settings::default(), VioState::empty());
    settings.landmarks.pixel_sigma = 0.7;
    for k in 0..40 {
        let pixel = Vector2::new(150.0 + 11.0 * f64::from(k), 80.0 + 61.0 * f64::from(k % 6));
        let bearing = Bearing::new(&first.bearing(&pixel).unwrap());
        let inverse_distance = InverseDistance::new(0.1 + 0.02 * f64::from(k));
        let landmark = Landmark::new(bearing, inverse_distance, Matrix2::identity() * 3.0);
        let measurement = StereoPixelMeasurement {
            row: crate::filter::state::error_state::FIXED,
            pixel: Vector2::zeros(),
            landmark,
            rate,
            time_offset_error: 0.01,
            rig: &rig,
            landmarks: &settings.landmarks,
            update: &settings.update,
        };
        // The residual is the pixel of zero less the predicted one.
        let rows = measurement.rows();
        let linearize = |delta: &Vector4<f64>| {
            let (state, rate_in_body) = (&state, &Vector3::zeros());
            measurement.linearize(&Trial { state, rate_in_body, rows: &rows, delta }).unwrap()
        };
        let Linearization { jacobian, noise, .. } = linearize(&Vector4::zeros());
        assert!((noise - Matrix2::identity() * 0.49).amax() < 1e-12, "{noise}");
        for column in 0..4 {
            let h = 1e-6;
            let [one, two] = [h, -h].map(|h| {
                let delta = Vector4::from_fn(|r, _| if r == column { h } else { 0.0 });
                -linearize(&delta).residual
            });
            let slope = (one - two) / (2.0 * h);
            // The time offset has moved the bearing by half a hundredth, as far as its two steps do not commute.
            assert!((slope - jacobian.column(column)).norm() < 1e-3 * jacobian.norm(), "column {column}");
        }
    }
}
