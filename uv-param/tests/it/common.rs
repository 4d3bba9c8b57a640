//! Small mesh readers and makers for the tests.

use std::path::PathBuf;

/// Vertices and triangles.
pub(crate) type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A mesh of the folder `tests/fixtures`.
pub(crate) fn fixture(name: &str) -> Mesh {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    read(&std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// A mesh of the data folder that `PAINTCOPTER_DATA` names; `None`, said on stderr, where there is none.
///
/// # Panics
/// If `PAINTCOPTER_REQUIRE_DATA` is set and there is none.
pub(crate) fn data_mesh(name: &str) -> Option<Mesh> {
    let text = std::fs::read_to_string(data_root()?.join(name)).ok();
    if text.is_none() {
        absent(&format!("the data folder holds no meshes/{name}"));
    }
    text.map(|text| read(&text))
}

fn data_root() -> Option<PathBuf> {
    let root = std::env::var_os("PAINTCOPTER_DATA").map(|root| PathBuf::from(root).join("meshes"));
    if root.is_none() {
        absent("PAINTCOPTER_DATA names no folder with meshes");
    }
    root
}

fn absent(what: &str) {
    assert!(std::env::var_os("PAINTCOPTER_REQUIRE_DATA").is_none(), "{what}, and PAINTCOPTER_REQUIRE_DATA is set");
    eprintln!("SKIPPED: {what}");
}

fn read(text: &str) -> Mesh {
    if text.starts_with("OFF") { read_off(text) } else { read_obj(text) }
}

/// All meshes of the data folder, relative to `meshes/`, sorted.
pub(crate) fn all_data_meshes() -> Vec<String> {
    let Some(root) = data_root() else { return Vec::new() };
    let mut found = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "obj" || e == "off") {
                found.push(path.strip_prefix(&root).unwrap().to_string_lossy().into_owned());
            }
        }
    }
    if found.is_empty() {
        absent("there are no meshes in the data folder");
    }
    found.sort();
    found
}

/// Positions and fanned faces of an OBJ text; everything else is ignored.
pub(crate) fn read_obj(text: &str) -> Mesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let p: Vec<f64> = words.take(3).map(|w| w.parse().unwrap()).collect();
                positions.push([p[0], p[1], p[2]]);
            }
            Some("f") => {
                let index = |w: &str| {
                    let i: i64 = w.split('/').next().unwrap().parse().unwrap();
                    if i < 0 { (positions.len() as i64 + i) as u32 } else { (i - 1) as u32 }
                };
                let corners: Vec<u32> = words.map(index).collect();
                faces.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    (positions, faces)
}

/// Positions and fanned faces of an OFF text.
pub(crate) fn read_off(text: &str) -> Mesh {
    let mut lines = text.lines().map(|l| l.split('#').next().unwrap().trim()).filter(|l| !l.is_empty());
    assert_eq!(lines.next(), Some("OFF"));
    let count: Vec<usize> = lines.next().unwrap().split_whitespace().map(|w| w.parse().unwrap()).collect();
    let positions = lines
        .by_ref()
        .take(count[0])
        .map(|l| {
            let p: Vec<f64> = l.split_whitespace().map(|w| w.parse().unwrap()).collect();
            [p[0], p[1], p[2]]
        })
        .collect();
    let mut faces = Vec::new();
    for line in lines.take(count[1]) {
        let c: Vec<u32> = line.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect();
        faces.extend((2..c.len()).map(|k| [c[0], c[k - 1], c[k]]));
    }
    (positions, faces)
}

/// A grid of `nx` x `ny` squares, each cut into two triangles, its vertices placed by `place`.
pub(crate) fn grid(nx: u32, ny: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for j in 0..=ny {
        for i in 0..=nx {
            positions.push(place(f64::from(i) / f64::from(nx), f64::from(j) / f64::from(ny)));
        }
    }
    let at = |i: u32, j: u32| j * (nx + 1) + i;
    for j in 0..ny {
        for i in 0..nx {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (positions, faces)
}

/// splitmix64.
pub(crate) struct Rng(pub u64);

impl Rng {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}
