//! A parametrizer of one's own: the closed form of a cylinder goes through texels, quality and nozzle commands.

use std::cell::Cell;
use std::f64::consts::PI;

use crate::common::grid;
use uv_param::disk::largest_disk_with;
use uv_param::nozzle::{NozzleSettings, nozzle_command};
use uv_param::parametrizer::{Arap, Layout, Progress, StoppingCriterion, SymmetricDirichlet, Tutte};
use uv_param::texture::TexelMap;
use uv_param::{Disk, Error, Method, Parametrizer, Settings, unwrap, unwrap_by};

const RADIUS: f64 = 0.5;
const HEIGHT: f64 = 1.0;
/// Half a turn.
const ARC: f64 = PI * RADIUS;

/// Half a cylinder about the z axis, its outside painted.
fn half_cylinder(columns: u32) -> Disk {
    let (positions, faces) = grid(columns, 8, |s, t| {
        let (sin, cos) = (PI * s).sin_cos();
        [RADIUS * cos, RADIUS * sin, HEIGHT * t]
    });
    largest_disk_with(&positions, &faces, uv_param::disk::Repair::default()).unwrap().0
}

/// Unrolls a cylinder about the z axis: u is the arc, v the height.
struct Unroll;

impl Parametrizer for Unroll {
    fn parametrize(&self, disk: &Disk, _: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
        let uv = disk.positions().iter().map(|p| [p[0].hypot(p[1]) * p[1].atan2(p[0]), p[2]]).collect();
        Ok(Layout { uv, iterations: 0 })
    }
}

#[test]
fn a_cylinder_unrolls_by_its_closed_form() {
    let disk = half_cylinder(64);
    let chart = unwrap_by(&disk, &Unroll, Some([0.0, 0.0, 1.0]), |_| ()).unwrap();
    assert!((chart.width() - ARC).abs() < 1e-9 && (chart.height() - HEIGHT).abs() < 1e-9);
    // A facet's chord is shorter than its arc by (pi / 64)^2 / 24: that is all the distortion there is.
    let chord = 2.0 * (PI / 128.0).sin() / (PI / 64.0);
    let quality = chart.quality();
    assert_eq!((quality.flips, quality.iterations), (0, 0));
    assert!((quality.stretch_max - 1.0 / chord).abs() < 1e-9, "{quality:?}");
    assert!((quality.arap - (1.0 / chord - 1.0).powi(2)).abs() < 1e-12);

    let texels = TexelMap::new(&chart, 0.0125).unwrap();
    assert_eq!((texels.width, texels.height), (126, 80));
    let facets = 64.0 * 2.0 * RADIUS * (PI / 128.0).sin() * HEIGHT;
    assert!((texels.area_m2.iter().sum::<f64>() - facets).abs() < 1e-9);

    let settings = NozzleSettings::default();
    for k in 1..20 {
        let uv = [ARC * f64::from(k) / 20.0, 0.3];
        let command = nozzle_command(&chart, uv, &settings).unwrap();
        // Seen from outside u runs right, which is the way the angle grows.
        let (sin, cos) = (uv[0] / RADIUS).sin_cos();
        let off_axis = command.point.coords.xy().norm();
        assert!((off_axis - RADIUS).abs() < RADIUS * (1.0 - (PI / 128.0).cos()) + 1e-12);
        assert!((command.point.z - 0.3).abs() < 1e-9);
        let outward = nalgebra::Vector3::new(cos, sin, 0.0);
        assert!((command.direction.into_inner() + outward).norm() < 0.03, "{k}: {:?}", command.direction);
        assert!(((command.position - command.point).norm() - settings.stand_off()).abs() < 1e-9);
    }
}

#[test]
fn the_built_in_parametrizers_agree_with_unwrap() {
    let disk = half_cylinder(16);
    let stopping = StoppingCriterion::default();
    let pairs: [(&dyn Parametrizer, Method); 2] =
        [(&Arap { stopping }, Method::Arap), (&SymmetricDirichlet { stopping }, Method::SymmetricDirichlet)];
    for (parametrizer, method) in pairs {
        let calls = Cell::new(0);
        let by_trait = unwrap_by(&disk, parametrizer, None, |_| calls.set(calls.get() + 1)).unwrap();
        let by_method = unwrap(&disk, &Settings { method, ..Settings::default() }, |_| ()).unwrap();
        assert_eq!(by_trait.uv(), by_method.uv());
        assert_eq!(by_trait.quality(), by_method.quality());
        assert!(calls.get() > 1 && by_trait.quality().iterations > 0);
        // A half cylinder is developable: both energies end near an isometry.
        assert!(by_trait.quality().stretch_max < 1.02);
    }
    // Tutte's layout is injective and no more than that.
    let tutte = unwrap_by(&disk, &Tutte, None, |_| ()).unwrap();
    assert_eq!((tutte.quality().flips, tutte.quality().iterations), (0, 0));
    assert!(tutte.quality().stretch_max > 1.5);
}

/// A square metre of which a tenth is squeezed to half of its width: all that is said of its quality, by hand.
#[test]
fn quality_is_that_of_the_triangles_by_their_area() {
    struct Squeezed;
    impl Parametrizer for Squeezed {
        fn parametrize(&self, disk: &Disk, _: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
            let uv = disk.positions().iter().map(|p| [p[0].min(0.9) + 0.5 * (p[0] - 0.9).max(0.0), p[1]]).collect();
            Ok(Layout { uv, iterations: 0 })
        }
    }
    // The columns are narrow where nothing is squeezed: a tenth of the area is a twentieth of the triangles.
    let (positions, faces) =
        grid(20, 10, |s, t| [if s < 0.95 { s * 0.9 / 0.95 } else { 0.9 + (s - 0.95) * 2.0 }, t, 0.0]);
    let disk = largest_disk_with(&positions, &faces, uv_param::disk::Repair::default()).unwrap().0;
    let chart = unwrap_by(&disk, &Squeezed, None, |_| ()).unwrap();
    let quality = chart.quality();
    for (what, found, expected) in [
        ("largest stretch", quality.stretch_max, 2.0),
        ("stretch, 99 %", quality.stretch_p99, 2.0),
        ("error of length", quality.length_err_mean, 0.1 * 0.5),
        ("error of length, 99 %", quality.length_err_p99, 0.5),
        ("rigidity", quality.arap, 0.1 * 0.25),
        // Squares of stretches and of their inverses, over four.
        ("symmetric Dirichlet", quality.symmetric_dirichlet, 0.9 + 0.1 * (1.0 + 1.0 + 0.25 + 4.0) / 4.0),
        ("area", quality.area_m2, 1.0),
        ("overlap", quality.overlap_share, 0.0),
    ] {
        assert!((found - expected).abs() < 1e-9, "{what}: {found} instead of {expected}");
    }
}

#[test]
fn bad_parametrizers_are_refused() {
    struct Short;
    impl Parametrizer for Short {
        fn parametrize(&self, _: &Disk, _: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
            Ok(Layout { uv: vec![[0.0; 2]; 3], iterations: 0 })
        }
    }
    let disk = half_cylinder(4);
    assert!(matches!(unwrap_by(&disk, &Short, None, |_| ()), Err(Error::Length { what: "uv", .. })));
    assert!(matches!(unwrap_by(&disk, &Unroll, Some([0.0; 3]), |_| ()), Err(Error::Setting { name: "up", .. })));
    let never = Arap { stopping: StoppingCriterion { iterations: 0, ..StoppingCriterion::default() } };
    assert!(matches!(unwrap_by(&disk, &never, None, |_| ()), Err(Error::Setting { name: "iterations", .. })));
}
