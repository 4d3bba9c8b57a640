//! Depth with gaps and ragged edges, as strangers' cameras give it.

use nalgebra::{Isometry3, Point3};
use tsdf_hash::{FrameReport, Map, Settings};

use crate::scene::{Shot, look_at, room};

/// Images of the room with some of their pixels taken away; the reports of their fusion and the mesh's distances from the truth.
fn rebuilt(gone: impl Fn(usize, usize) -> bool) -> (Vec<FrameReport>, Vec<f64>) {
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    let mut reports = Vec::new();
    for mut shot in room::tour(20, 2, &Isometry3::identity()) {
        for (k, z) in shot.depth.iter_mut().enumerate() {
            if gone(k % shot.width, k / shot.width) {
                *z = 0.0;
            }
        }
        reports.push(map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap());
    }
    let errors = map.mesh().positions.iter().map(|p| room::sdf(&Point3::from(p.map(f64::from))).abs()).collect();
    (reports, errors)
}

/// What the registration of depth to another camera leaves: every fifth row and column is empty.
#[test]
fn a_grid_of_gaps_costs_nothing() {
    let (whole, whole_errors) = rebuilt(|_, _| false);
    let (reports, errors) = rebuilt(|u, v| u % 5 == 0 || v % 5 == 0);
    for (report, whole) in reports.iter().zip(&whole) {
        assert!(report.fused_pixels as f64 > 0.99 * report.valid_pixels as f64, "{report:?}");
        // Nearly as many pixels as without the grid, the gaps among them.
        assert_eq!(whole.filled_pixels, 0);
        let all = report.fused_pixels + report.filled_pixels;
        assert!(all as f64 > 0.97 * whole.fused_pixels as f64, "{all} of {}", whole.fused_pixels);
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    // A rim in a gap is known a pixel later.
    assert!(errors.len() as f64 > 0.985 * whole_errors.len() as f64, "{} of {}", errors.len(), whole_errors.len());
    assert!(mean < 0.3e-3, "mean {mean}");
}

/// A slat two pixels wide, half a metre before a wall: all of its pixels lie on edges.
#[test]
fn a_thin_slat_is_kept() {
    let pose = look_at(Point3::origin(), Point3::new(1.0, 0.0, 0.0));
    let shot = Shot::take((160, 120), [130.0; 2], pose, |o, d| {
        let slat = (1.0 - o.x) / d.x;
        let aside = o.y + slat * d.y;
        Some(if aside.abs() < 0.0077 { slat } else { (1.5 - o.x) / d.x })
    });
    let slat: Vec<usize> = (0..shot.depth.len()).filter(|&k| shot.depth[k] < 1.2).collect();
    assert_eq!(slat.len(), 2 * 120, "two pixels wide");
    let mut map = Map::new(Settings { voxel_size: 0.005, ..Settings::default() }).unwrap();
    let report = map.integrate(&shot.view(), None, &pose).unwrap();
    assert_eq!(report.fused_pixels, report.valid_pixels);
    // All along the slat the map knows its surface.
    for k in -20..=20 {
        let point = Point3::new(0.998, 0.0, f64::from(k) * 0.02);
        let distance = map.distance(&point).unwrap_or(f64::NAN);
        assert!((distance - 0.002).abs() < 1e-4, "{distance} at {point}");
    }
}

/// Between two surfaces nothing is filled.
#[test]
fn a_gap_between_two_depths_stays_one() {
    let pose = look_at(Point3::origin(), Point3::new(1.0, 0.0, 0.0));
    let mut shot =
        Shot::take((160, 120), [130.0; 2], pose, |o, d| Some((if d.y > 0.0 { 1.0 } else { 1.3 } - o.x) / d.x));
    let edge = (1..160).find(|&u| (shot.depth[u] - shot.depth[u - 1]).abs() > 0.2).unwrap();
    (0..120).for_each(|v| shot.depth[v * 160 + edge] = 0.0);
    let mut map = Map::new(Settings { voxel_size: 0.01, ..Settings::default() }).unwrap();
    let report = map.integrate(&shot.view(), None, &pose).unwrap();
    assert_eq!(report.filled_pixels, 0);
    assert_eq!(report.valid_pixels, 159 * 120);
}
