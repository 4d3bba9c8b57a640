//! Designs go on across seams: on both sides of every seam they are what the design is without any.

use std::collections::HashMap;
use std::f64::consts::TAU;

use nalgebra::Point3;
use paintcopter::design::{Design, Picture};
use paintcopter::mesh_io::{TriangleMesh, read_mesh};
use paintcopter::mesh_placement::{MeshPlacement, UpAxis, place_mesh};
use paintcopter::picture_placement::PicturePlacement;
use paintcopter::surface::PaintSurface;

use crate::recorded::recorded;
use crate::scratch::Scratch;

const TEXEL: f64 = 0.02;
/// Samples along every edge of a seam.
const SAMPLES: usize = 5;

/// A closed grid of quads over two angles; poles are rings of tiny radius.
fn closed(sides: [u32; 2], at: impl Fn(f64, f64) -> [f64; 3], round: bool) -> TriangleMesh {
    let [around, along] = sides;
    let rows = if round { along } else { along + 1 };
    let mut mesh = TriangleMesh::default();
    for j in 0..rows {
        for i in 0..around {
            let p = at(f64::from(i) / f64::from(around), f64::from(j) / f64::from(along));
            mesh.positions.push(p.map(|c| c as f32));
        }
    }
    let index = |i: u32, j: u32| (j % rows) * around + i % around;
    for j in 0..along {
        for i in 0..around {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn sphere() -> TriangleMesh {
    let at = |u: f64, v: f64| {
        let ((sin, cos), ring) = ((TAU * u).sin_cos(), (0.5 * TAU * (0.002 + 0.996 * v)).sin());
        [0.6 * ring * cos, 0.6 * ring * sin, 1.5 - 0.6 * (0.5 * TAU * (0.002 + 0.996 * v)).cos()]
    };
    closed([40, 24], at, false)
}

fn torus() -> TriangleMesh {
    let at = |u: f64, v: f64| {
        let ((sin, cos), (up, out)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
        let radius = 0.7 + 0.3 * out;
        [0.3 * up, radius * cos, 1.5 + radius * sin]
    };
    closed([48, 24], at, true)
}

/// A design without seams: ink at a point of space.
type Law<'a> = &'a dyn Fn(&Point3<f64>) -> f64;

/// The picture plane of the sketch: metres right of the left end and below the top, and its width and height.
struct Sketch {
    low: [f64; 3],
    high: [f64; 3],
}

impl Sketch {
    fn of(surface: &PaintSurface) -> Self {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for k in 0..surface.width() * surface.height() {
            if let Some(at) = surface.texels.at(k % surface.width(), k / surface.width()) {
                let p = surface.chart.point(at);
                for c in 0..3 {
                    (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
                }
            }
        }
        Self { low, high }
    }

    /// Shares of the width from the left, as the robot sees it (+y is left), and of the height from the top.
    fn place(&self, p: &Point3<f64>) -> [f64; 2] {
        [(self.high[1] - p.y) / (self.high[1] - self.low[1]), (self.high[2] - p.z) / (self.high[2] - self.low[2])]
    }

    /// The stripes by their definition.
    fn stripes(&self, p: &Point3<f64>) -> f64 {
        let stripe = (11.0 * self.place(p)[0]).floor().clamp(0.0, 10.0);
        if stripe % 2.0 == 0.0 { 0.85 * (0.25 + 0.75 * stripe / 10.0) } else { 0.05 }
    }

    /// The gradient by its definition.
    fn gradient(&self, p: &Point3<f64>) -> f64 {
        let [u, v] = self.place(p);
        (0.85 * u + 0.06 * (3.0 * TAU * v).sin() * (0.5 * TAU * u).sin()).clamp(0.0, 0.85)
    }

    /// Dark left of the middle.
    fn half(&self, p: &Point3<f64>) -> f64 {
        if self.place(p)[0] < 0.5 { 0.85 } else { 0.0 }
    }
}

/// Pairs of texels on the two sides of a seam, and how far apart they lie on the surface, m.
fn across_seams(surface: &PaintSurface) -> Vec<[(usize, Point3<f64>); 2]> {
    let disk = surface.disk();
    let key = |v: u32| disk.positions()[v as usize].map(f64::to_bits);
    // Every side of an edge: the face, and its corner before the edge.
    let mut sides: HashMap<[[u64; 3]; 2], Vec<(u32, usize)>> = HashMap::new();
    for (face, corners) in disk.faces().iter().enumerate() {
        for k in 0..3 {
            let mut edge = [key(corners[k]), key(corners[(k + 1) % 3])];
            edge.sort_unstable();
            sides.entry(edge).or_default().push((face as u32, k));
        }
    }
    let corner = |face: u32, k: usize| disk.faces()[face as usize][k % 3];
    let uv = |face: u32, k: usize| surface.chart.uv()[corner(face, k) as usize];
    let (width, height) = (surface.width(), surface.height());
    // The texel a little inside the face beside the edge, at a share of the way along it.
    let texel = |(face, k): (u32, usize), share: f64| {
        let (a, b, c) = (uv(face, k), uv(face, k + 1), uv(face, k + 2));
        let at = [0, 1].map(|i| 0.98 * (a[i] + share * (b[i] - a[i])) + 0.02 * c[i]);
        let (x, y) = ((at[0] / TEXEL) as usize, height - 1 - ((at[1] / TEXEL) as usize).min(height - 1));
        let on_surface = (x < width).then(|| surface.texels.at(x, y)).flatten()?;
        Some((y * width + x, surface.chart.point(on_surface)))
    };
    let mut pairs = Vec::new();
    for sides in sides.into_values().filter(|sides| sides.len() == 2) {
        let same_edge = |i: usize| corner(sides[0].0, sides[0].1 + i) == corner(sides[1].0, sides[1].1 + 1 - i);
        if same_edge(0) && same_edge(1) {
            continue;
        }
        for k in 0..SAMPLES {
            let share = (k as f64 + 0.5) / SAMPLES as f64;
            pairs.extend(texel(sides[0], share).zip(texel(sides[1], 1.0 - share)).map(|(a, b)| [a, b]));
        }
    }
    pairs
}

fn half_dark() -> Picture {
    let s = Scratch::new("designs_across_seams");
    let path = s.0.join("half.png");
    image::GrayImage::from_fn(64, 64, |x, _| image::Luma([if x < 32 { 0 } else { 255 }])).save(&path).unwrap();
    Picture::open(&path).unwrap()
}

/// Breaks of a surface: texels beside a seam that are not what the design is there, and neighbours across it between which there is a step
/// that the design does not have.
fn check(name: &str, mesh: &TriangleMesh) {
    let surface = PaintSurface::new(mesh, TEXEL, &|_| ()).unwrap();
    let (sketch, pairs) = (Sketch::of(&surface), across_seams(&surface));
    assert!(pairs.len() > 100, "{name}: {} pairs", pairs.len());
    let stretch = PicturePlacement {
        mode: paintcopter::picture_placement::PlacementMode::Stretch,
        ..PicturePlacement::default()
    };
    let plain = PicturePlacement::default();
    let designs: [(&str, Design, &PicturePlacement, Law); 3] = [
        ("stripes", Design::Stripes, &plain, &|p| sketch.stripes(p)),
        ("gradient", Design::Gradient, &plain, &|p| sketch.gradient(p)),
        ("picture", Design::Picture(half_dark()), &stretch, &|p| sketch.half(p)),
    ];
    for (design_name, design, placement, law) in designs {
        let ink = design.on_surface(&surface, mesh, placement, None).unwrap();
        // A picture is smooth over one of its pixels, and a step lies within rounding of a texel.
        let near_step = |p: &Point3<f64>| match design_name {
            "stripes" => (11.0 * sketch.place(p)[0]).fract().min(1.0 - (11.0 * sketch.place(p)[0]).fract()) < 1e-6,
            "picture" => (sketch.place(p)[0] - 0.5).abs() < 1.0 / 64.0,
            _ => false,
        };
        let (mut wrong, mut steps) = (0, 0);
        for [a, b] in &pairs {
            for (k, p) in [a, b] {
                wrong += usize::from(!near_step(p) && (ink.data()[*k] - law(p)).abs() > 1e-6);
            }
            let step = (ink.data()[a.0] - ink.data()[b.0]).abs();
            steps += usize::from(!near_step(&a.1) && !near_step(&b.1) && step > (law(&a.1) - law(&b.1)).abs() + 1e-6);
        }
        println!("| {name} | {design_name} | {} pairs across seams | {wrong} wrong | {steps} breaks |", pairs.len());
        assert_eq!((wrong, steps), (0, 0), "{name}, {design_name}");
    }
    // Strata have no short law: neighbours across a seam differ by no more than their distance allows.
    let ink = Design::Strata { seed: 3 }.on_surface(&surface, mesh, &plain, None).unwrap();
    let torn = pairs.iter().filter(|[a, b]| {
        let (apart, step) = ((a.1 - b.1).norm(), (ink.data()[a.0] - ink.data()[b.0]).abs());
        step > 0.1 + 15.0 * apart
    });
    assert_eq!(torn.count(), 0, "{name}, strata");
}

#[test]
fn nothing_breaks_at_the_seams_of_closed_surfaces() {
    check("torus", &torus());
    check("sphere", &sphere());
}

#[test]
#[ignore = "recorded statues: cargo test --release --workspace --all-features --test it -- --ignored designs_across_seams"]
fn nothing_breaks_at_the_seams_of_statues() {
    for (file, up) in [
        ("meshes/odedstein/goathead/goathead.obj", UpAxis::Y),
        ("meshes/odedstein/demosthenes/demosthenes-low-res.obj", UpAxis::Y),
        ("meshes/common3d/spot.obj", UpAxis::Y),
    ] {
        let Some(path) = recorded(file) else { return };
        let mut mesh = read_mesh(&path).unwrap();
        place_mesh(&mut mesh, MeshPlacement { scale: None, up }).unwrap();
        check(file, &mesh);
    }
}
