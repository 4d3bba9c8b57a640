//! Patches, pyramid and corners against closed forms and against dense least squares.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2, Vector3};

use super::corner_detector::{CornerDetector, DetectionCriteria};
use super::patch::{LEVELS, Patch};
use super::patch_slant::{PatchSlant, SlantEvidence};
use super::pyramid::Pyramid;
use crate::filter::settings::PatchSettings;
use crate::filter::state::bearing::Bearing;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;
use crate::samples::ImageView;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

/// A smooth picture with structure in all directions, shifted, and with another gain and offset.
fn picture(shift: Vector2<f64>, gain: f64, offset: f64) -> Vec<u8> {
    let value = |x: f64, y: f64| {
        let waves = [(0.33, 0.15, 0.3), (-0.12, 0.39, 1.9), (0.27, -0.3, 4.0), (0.45, 0.36, 0.7)];
        waves.iter().map(|(a, b, c)| 25.0 * (a * x + b * y + c).sin()).sum::<f64>()
    };
    (0..WIDTH * HEIGHT)
        .map(|k| {
            let (x, y) = ((k % WIDTH) as f64, (k / WIDTH) as f64);
            (offset + gain * value(x - shift.x, y - shift.y)).round().clamp(0.0, 255.0) as u8
        })
        .collect()
}

fn pyramid(data: &[u8]) -> Pyramid {
    let mut pyramid = Pyramid::new(WIDTH, HEIGHT, 0, LEVELS);
    pyramid.fill(&ImageView { width: WIDTH, height: HEIGHT, data });
    pyramid
}

const MIDDLE: Vector2<f64> = Vector2::new(80.0, 60.0);

/// A picture warped about its middle.
fn warped(from: &Pyramid, warp: &Matrix2<f64>) -> Pyramid {
    let inverse = warp.try_inverse().unwrap();
    let level = &from.patch_levels()[0];
    let data: Vec<u8> = (0..WIDTH * HEIGHT)
        .map(|k| {
            let source = MIDDLE + inverse * (Vector2::new((k % WIDTH) as f64, (k / WIDTH) as f64) - MIDDLE);
            let inside = level.contains(&source, &Vector2::zeros());
            if inside { level.interpolate(source.x as f32, source.y as f32).round() as u8 } else { 0 }
        })
        .collect();
    pyramid(&data)
}

#[test]
fn levels_lie_where_they_are_said_to() {
    // A ramp keeps its value under box means, if the positions are right.
    let ramp: Vec<u8> = (0..WIDTH * HEIGHT).map(|k| (k % WIDTH + k / WIDTH / 2) as u8).collect();
    let pyramid = pyramid(&ramp);
    assert_eq!(pyramid.patch_levels().len(), LEVELS);
    for level in pyramid.patch_levels() {
        for (x, y) in [(40.0, 30.0), (77.25, 61.5), (100.5, 90.0)] {
            let at = level.position(&Vector2::new(x, y));
            assert!((level.pixel(&at) - Vector2::new(x, y)).norm() < 1e-12);
            let value = f64::from(level.interpolate(at.x as f32, at.y as f32));
            // Rounding of the ramp's halves, and of each level's means.
            assert!((value - (x + y / 2.0)).abs() < 1.1, "{value} at ({x}, {y})");
        }
    }
}

#[test]
fn finds_a_shift_whatever_the_brightness() {
    let reference = pyramid(&picture(Vector2::zeros(), 1.0, 128.0));
    for (k, (gain, offset)) in [(1.0, 128.0), (0.5, 90.0), (1.2, 125.0)].into_iter().enumerate() {
        for (x, y) in [(60.0, 50.0), (81.0, 63.0), (95.5, 70.5)] {
            let middle = Vector2::new(x, y);
            let shift = Vector2::new(0.7 - k as f64, 0.45 * k as f64 - 0.3);
            let other = pyramid(&picture(shift, gain, offset));
            let patch = Patch::extract(&reference, &middle).unwrap();
            let mut at = middle;
            for _ in 0..10 {
                let c = patch.compare(&other, &at, &Matrix2::identity()).unwrap();
                at += c.information.try_inverse().unwrap() * c.gradient;
            }
            // Linear interpolation dampens the finer waves, which shifts the rest by up to a twentieth of a pixel of the
            // coarser level.
            assert!((at - middle - shift).norm() < 0.2, "{shift} found as {}", at - middle);
        }
    }
}

#[test]
fn a_warped_patch_fits_with_its_warp() {
    // The picture turned and scaled about a point: the same patch with the warp that says so fits at once.
    let warp = Matrix2::new(1.1, 0.15, -0.1, 0.95);
    let reference = pyramid(&picture(Vector2::zeros(), 1.0, 128.0));
    let (middle, other) = (MIDDLE, warped(&reference, &warp));
    let patch = Patch::extract(&reference, &middle).unwrap();
    let right = patch.compare(&other, &middle, &warp).unwrap();
    let wrong = patch.compare(&other, &middle, &Matrix2::identity()).unwrap();
    assert!(right.ssd < 0.02 * right.energy, "{} of {}", right.ssd, right.energy);
    assert!(wrong.ssd > 5.0 * right.ssd);
    assert!((right.information.try_inverse().unwrap() * right.gradient).norm() < 0.1);
}

#[test]
fn normal_equations_are_those_of_a_least_squares_with_gain_and_offset() {
    // One level by brute force: columns gradient x, gradient y, the patch, and one.
    let data = picture(Vector2::zeros(), 1.0, 128.0);
    let other = picture(Vector2::new(0.4, -0.2), 0.8, 120.0);
    let (reference, other) = (pyramid(&data), pyramid(&other));
    let middle = Vector2::new(70.0, 55.0);
    let patch = Patch::extract(&reference, &middle).unwrap();
    let ours = patch.compare_coarse(&other, &middle, &Matrix2::identity()).unwrap();

    let level = &reference.patch_levels()[LEVELS - 1];
    let at = level.position(&middle);
    let value = |of: &Pyramid, x: f64, y: f64| f64::from(of.patch_levels()[LEVELS - 1].interpolate(x as f32, y as f32));
    let (mut columns, mut samples) = (DMatrix::zeros(36, 4), DVector::zeros(36));
    for row in 0..6 {
        for column in 0..6 {
            let (x, y) = (at.x - 2.5 + f64::from(column), at.y - 2.5 + f64::from(row));
            let k = (row * 6 + column) as usize;
            let slope = |dx: f64, dy: f64| {
                (value(&reference, x + dx, y + dy) - value(&reference, x - dx, y - dy)) / 2.0 * level.scale
            };
            columns[(k, 0)] = slope(1.0, 0.0);
            columns[(k, 1)] = slope(0.0, 1.0);
            columns[(k, 2)] = value(&reference, x, y);
            columns[(k, 3)] = 1.0;
            samples[k] = value(&other, x, y);
        }
    }
    let solution = columns.clone().svd(true, true).solve(&samples, 1e-12).unwrap();
    let rest = (&columns * &solution - &samples).norm_squared();
    // The patch moved by +s is what is seen at −s: samples = gain · (patch − gradient · s). The gain is taken before the shift
    // is, so it may differ by what the gradients correlate with the patch, which the projection removes.
    let gain = {
        let mean = columns.column(2).mean();
        let centred = columns.column(2).add_scalar(-mean);
        centred.dot(&samples) / centred.norm_squared()
    };
    let shift = -Vector2::new(solution[0], solution[1]) / gain;
    let found = ours.information.try_inverse().unwrap() * ours.gradient;
    assert!((found - shift).norm() < 1e-4, "{found} {shift}");
    assert!((ours.residual - rest / (gain * gain)).abs() < 1e-3 * ours.ssd);
}

#[test]
fn corners_are_found_where_they_are() {
    // Bright squares on grey: four corners each, and nothing anywhere else.
    let mut data = vec![90_u8; WIDTH * HEIGHT];
    let squares = [(14, 30), (90, 50)];
    for (x0, y0) in squares {
        for y in y0..y0 + 48 {
            data[y * WIDTH + x0..y * WIDTH + x0 + 48].fill(170);
        }
    }
    let pyramid = pyramid(&data);
    let mut detector = CornerDetector::new(pyramid.corner_level(), 10);
    let criteria = DetectionCriteria { min_score: 1.0, min_distance: 10.0, penalty_distance: 20.0 };
    let taken = Vector2::new(14.0, 30.0);
    detector.detect(&pyramid, &std::iter::once(taken), &criteria);
    let mut found: Vec<Vector2<f64>> = Vec::new();
    while let Some((pixel, _)) = detector.take_best(&pyramid, &criteria) {
        let corners = squares.iter().flat_map(|&(x, y)| {
            [(x, y), (x + 47, y), (x, y + 47), (x + 47, y + 47)].map(|(x, y)| Vector2::new(x as f64, y as f64))
        });
        let off = corners.map(|c| (c - pixel).norm()).fold(f64::INFINITY, f64::min);
        assert!(off < 8.0, "{pixel} is no corner");
        assert!((pixel - taken).norm() >= 10.0 && found.iter().all(|f| (f - pixel).norm() >= 10.0));
        found.push(pixel);
    }
    assert!(found.len() >= 6, "{} of 7", found.len());
    // A blank image has none.
    let blank = self::pyramid(&vec![90; WIDTH * HEIGHT]);
    detector.detect(&blank, &std::iter::empty(), &criteria);
    assert!(detector.take_best(&blank, &criteria).is_none());
    assert!(Patch::extract(&blank, &Vector2::new(80.0, 60.0)).is_none());
}

#[test]
fn a_deformation_is_seen_besides_a_shift() {
    let reference = pyramid(&picture(Vector2::zeros(), 1.0, 128.0));
    let patch = Patch::extract(&reference, &MIDDLE).unwrap();
    for deformation in [Matrix2::new(0.04, 0.0, 0.0, 0.0), Matrix2::new(-0.02, 0.05, 0.03, 0.01), Matrix2::zeros()] {
        let other = warped(&reference, &(Matrix2::identity() + deformation));
        // A little beside where it is.
        let at = MIDDLE + Vector2::new(0.1, -0.05);
        let seen = patch.deformation(&other, &at, &Matrix2::identity()).unwrap();
        let found = Matrix2::from_column_slice((seen.information.try_inverse().unwrap() * seen.gradient).as_slice());
        assert!((found - deformation).amax() < 0.012, "{found} for {deformation}");
    }
}

/// A surface is seen from places farther and farther aside: its slope is found, and none where it faces the camera.
#[test]
fn a_slant_is_found_by_parallax() {
    let focal = 400.0;
    let reference = pyramid(&picture(Vector2::zeros(), 1.0, 128.0));
    let patch = Patch::extract(&reference, &MIDDLE).unwrap();
    let (settings, by_bearing) = (PatchSettings::default(), Matrix2::identity() * focal);
    let new = Landmark::new(Bearing::new(&Vector3::z_axis()), InverseDistance::new(0.4), Matrix2::identity() / focal);
    // At 31 degrees to the line of sight, and at 34: tangents of 0.6 and 0.67, by focal length and distance.
    for slope in [Vector2::zeros(), Vector2::new(6e-4, 0.0), Vector2::new(-4e-4, 5.4e-4)] {
        let (mut slant, mut found) = (PatchSlant::default(), Vector2::zeros());
        for step in 1..=40 {
            // Metres that the camera has moved aside.
            let by_distance = Vector3::new(-0.01, 0.003, 0.0) * f64::from(step) + Vector3::z();
            let at = |slope: &Vector2<f64>| {
                let mut landmark = Landmark { by_distance, ..new };
                landmark.tilt(slope);
                landmark
            };
            let image = warped(&reference, &(by_bearing * at(&slope).warp));
            let mut landmark = at(&found);
            let warp = by_bearing * landmark.warp;
            let comparison = patch.compare(&image, &MIDDLE, &warp).unwrap();
            let place = (&MIDDLE, &by_bearing);
            if let Some(evidence) = SlantEvidence::new(&landmark, (&patch, &image), place, &comparison, &settings) {
                slant.update(&evidence, &mut landmark);
            }
            found = landmark.slope;
        }
        assert!((found - slope).norm() < 0.2 * slope.norm() + 5e-5, "{found} for {slope}");
    }
}
