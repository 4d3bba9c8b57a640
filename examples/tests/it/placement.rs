//! Pictures stand upright and keep their proportions, whatever the shape of the surface and the axes of its file.

use paintcopter::design::{Design, Picture};
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mesh_placement::{MeshPlacement, UpAxis, place_mesh};
use paintcopter::picture_placement::{PicturePlacement, PlacementMode};
use paintcopter::projection::Viewpoint;
use paintcopter::surface::PaintSurface;

use crate::scratch::Scratch;

const TEXEL: f64 = 0.025;

/// A sheet over `(s, t)` in the unit square, s to the right and t up for who looks at it, in axes x to the right, y into the
/// wall, z up; it faces -y.
fn sheet(cells: (u32, u32), place: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
    let (columns, rows) = cells;
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let at = place(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            mesh.positions.push(at.map(|c| c as f32));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let corner = |r: u32, c: u32| (row + r) * (columns + 1) + column + c;
            let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Half of a face-like body: an ellipsoid with a nose, seen from its front.
fn bust(s: f64, t: f64) -> [f64; 3] {
    let (x, z) = (1.6 * (s - 0.5), 2.2 * (t - 0.5));
    let bulge = (1.0 - (x / 1.3).powi(2) - (z / 1.8).powi(2)).max(0.05).sqrt();
    let nose = 0.15 * (-(x * x + (z + 0.1).powi(2)) / 0.02).exp();
    [x, 0.5 - 0.5 * bulge - nose, z]
}

/// The surfaces, with the axis that points up in the file they are in.
fn surfaces() -> Vec<(&'static str, TriangleMesh, UpAxis)> {
    let arc = |s: f64, t: f64| {
        let angle = 2.0 * (s - 0.5);
        [angle.sin(), 1.0 - angle.cos(), 1.2 * t]
    };
    let mut y_up = sheet((8, 24), |s, t| [s, 0.0, 3.0 * t]);
    for p in &mut y_up.positions {
        *p = [p[0], p[2], -p[1]];
    }
    let mut x_up = sheet((12, 12), |s, t| [2.0 * s, 0.0, 2.0 * t]);
    for p in &mut x_up.positions {
        *p = [p[2], p[1], -p[0]];
    }
    vec![
        ("portrait of two triangles", sheet((1, 1), |s, t| [s, 0.0, 3.0 * t]), UpAxis::Z),
        ("landscape", sheet((24, 8), |s, t| [3.0 * s, 0.0, t]), UpAxis::Z),
        ("cylinder", sheet((24, 12), arc), UpAxis::Z),
        ("bust", sheet((30, 40), bust), UpAxis::Z),
        ("portrait, y up", y_up, UpAxis::Y),
        ("square, x up", x_up, UpAxis::X),
    ]
}

/// Dark in its upper left quarter.
fn picture(width: u32, height: u32) -> Picture {
    let s = Scratch::new("placement");
    let dark = |x: u32, y: u32| 2 * x < width && 2 * y < height;
    let path = s.0.join("picture.png");
    image::GrayImage::from_fn(width, height, |x, y| image::Luma([if dark(x, y) { 0 } else { 255 }]))
        .save(&path)
        .unwrap();
    Picture::open(&path).unwrap()
}

/// Width and height in metres, as the robot sees them, of what is painted, and its middle beside that of the surface (left is
/// negative). The robot looks along x, left is +y.
fn painted_box(mesh: &TriangleMesh, design: &Design, placement: &PicturePlacement, eye: Option<Viewpoint>) -> [f64; 4] {
    let surface = PaintSurface::new(mesh, TEXEL, &|_| ()).unwrap();
    let ink = design.on_surface(&surface, mesh, placement, eye).unwrap();
    let (mut all, mut dark) = ([f64::MAX, f64::MIN, f64::MAX, f64::MIN], [f64::MAX, f64::MIN, f64::MAX, f64::MIN]);
    for y in 0..surface.height() {
        for x in 0..surface.width() {
            let Some(at) = surface.texels.at(x, y) else { continue };
            let p = surface.chart.point(at);
            let grow = |b: &mut [f64; 4]| *b = [b[0].min(-p.y), b[1].max(-p.y), b[2].min(p.z), b[3].max(p.z)];
            grow(&mut all);
            if ink.at(x, y) > 0.4 {
                grow(&mut dark);
            }
        }
    }
    let middle = |b: &[f64; 4]| [0.5 * (b[0] + b[1]), 0.5 * (b[2] + b[3])];
    let (of_all, of_dark) = (middle(&all), middle(&dark));
    [dark[1] - dark[0], dark[3] - dark[2], of_dark[0] - of_all[0], of_dark[1] - of_all[1]]
}

#[test]
fn pictures_stand_upright_and_keep_their_proportions_on_every_surface() {
    let design = Design::Picture(picture(60, 60));
    for (name, mut mesh, up) in surfaces() {
        place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up }).unwrap();
        for eye in [None, Some(Viewpoint::Front)] {
            let [width, height, right, above] = painted_box(&mesh, &design, &PicturePlacement::default(), eye);
            assert!(right < -0.1 && above > 0.1, "{name}, {eye:?}: {right:.2} m to the right, {above:.2} m up");
            // The quarter of a square is a square; on a chart it is one on the surface, which a bend shows narrower.
            let bent = eye.is_none() && ["cylinder", "bust"].contains(&name);
            let tolerance = if bent { 0.2 * height } else { 2.0 * TEXEL };
            assert!((width - height).abs() < tolerance, "{name}, {eye:?}: {width:.2} x {height:.2} m");
        }
    }
}

/// On a wall of 3 x 1 m, for a picture twice as wide as high.
#[test]
fn the_options_of_placement_do_what_they_say() {
    let mut mesh = sheet((24, 8), |s, t| [3.0 * s, 0.0, t]);
    place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up: UpAxis::Z }).unwrap();
    let design = Design::Picture(picture(80, 40));
    let check = |placement: PicturePlacement, expected: [f64; 4]| {
        let found = painted_box(&mesh, &design, &placement, None);
        for (f, e) in found.iter().zip(expected) {
            // The dark part ends on the middle of texels.
            assert!((f - e).abs() < 2.0 * TEXEL, "{placement:?}: {found:?}, wanted {expected:?}");
        }
    };
    let plain = PicturePlacement::default();
    check(plain, [1.0, 0.5, -0.5, 0.25]);
    check(PicturePlacement { mode: PlacementMode::Stretch, ..plain }, [1.5, 0.5, -0.75, 0.25]);
    // 3 x 1.5 m, of which a metre is left: a quarter is cut off above and below.
    check(PicturePlacement { mode: PlacementMode::Fill, ..plain }, [1.5, 0.5, -0.75, 0.25]);
    check(PicturePlacement { size: Some(0.8), offset: [0.6, -0.1], ..plain }, [0.4, 0.2, 0.4, 0.0]);
    // Upright after a quarter turn: 0.5 x 1 m, its upper left quarter is now the lower left one.
    check(PicturePlacement { rotate: std::f64::consts::FRAC_PI_2, ..plain }, [0.25, 0.5, -0.125, -0.25]);
}

/// A slide thrown from the side lands where straight lines from there meet the wall, and nothing behind an edge.
#[test]
fn a_picture_is_thrown_from_a_viewpoint() {
    // A wall of 2 x 2 m with a fin of half a metre in its middle, seen from its left.
    let fin = |s: f64, t: f64| {
        let x = 2.0 * s;
        [x, if (x - 1.0).abs() < 0.13 { -0.5 } else { 0.0 }, 2.0 * t]
    };
    let mut mesh = sheet((16, 8), fin);
    place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up: UpAxis::Z }).unwrap();
    let surface = PaintSurface::new(&mesh, TEXEL, &|_| ()).unwrap();
    let all_dark = {
        let s = Scratch::new("slide");
        let path = s.0.join("dark.png");
        image::GrayImage::from_pixel(8, 8, image::Luma([0])).save(&path).unwrap();
        Design::Picture(Picture::open(&path).unwrap())
    };
    let stretch = PicturePlacement { mode: PlacementMode::Stretch, ..PicturePlacement::default() };
    let eye = Viewpoint::Point([-3.0, 3.0, 2.5].into());
    let ink = all_dark.on_surface(&surface, &mesh, &stretch, Some(eye)).unwrap();
    let (mut left, mut right, mut shade) = (Vec::new(), Vec::new(), Vec::new());
    for y in 0..surface.height() {
        for x in 0..surface.width() {
            let Some(at) = surface.texels.at(x, y) else { continue };
            let p = surface.chart.point(at);
            // On the back wall only; the robot looks along x, left is +y.
            if surface.chart.face_normal(at.face).x > -0.999 || p.x < 0.2 {
                continue;
            }
            let side = match p.y {
                across if across > 0.3 => &mut left,
                across if across < -0.9 => &mut right,
                across if (-0.5..-0.3).contains(&across) => &mut shade,
                _ => continue,
            };
            side.push(ink.at(x, y));
        }
    }
    assert!(left.iter().all(|&i| i > 0.5) && !left.is_empty());
    assert!(right.iter().all(|&i| i > 0.5) && !right.is_empty());
    assert!(shade.iter().all(|&i| i == 0.0) && !shade.is_empty());
}

/// Told where to lie, a design that covers the surface or lies on the mesh refuses instead of ignoring it.
#[test]
fn designs_that_cannot_be_moved_say_so() {
    let refusal = |design: &Design, placement: &PicturePlacement, eye: Option<Viewpoint>| {
        design.check_movable(placement, eye).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let (usual, turned) =
        (PicturePlacement::default(), PicturePlacement { rotate: 0.1, ..PicturePlacement::default() });
    assert_eq!(refusal(&Design::Stripes, &usual, Some(Viewpoint::Front)), "");
    assert!(refusal(&Design::Stripes, &turned, None).contains("--rotate"));
    assert_eq!(refusal(&Design::VertexColours, &usual, None), "");
    assert!(refusal(&Design::VertexColours, &usual, Some(Viewpoint::Front)).contains("--project"));
    assert_eq!(refusal(&Design::Picture(picture(4, 4)), &turned, Some(Viewpoint::Front)), "");
}
