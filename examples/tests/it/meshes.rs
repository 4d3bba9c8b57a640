//! Reading meshes: the same surface in every format, and the broken ones of public collections without a panic.

use std::path::{Path, PathBuf};

use paintcopter_examples::mesh_io::{MeshError, TriangleMesh, read_mesh, write_ply};
use paintcopter_examples::surface::PaintSurface;

fn write(name: &str, bytes: &[u8]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("paintcopter-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn read(name: &str, bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let path = write(name, bytes);
    let mesh = read_mesh(&path);
    std::fs::remove_file(path).unwrap();
    mesh
}

#[test]
fn one_square_in_every_format() {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.5]];
    let faces = vec![[0, 1, 2], [0, 2, 3]];
    let obj = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
               f 1/1/7 2/2/7 3/3/7 -1/-1\n";
    let ascii = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                 property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
                 property list uchar int vertex_indices\nend_header\n\
                 0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0.5 51 51 51\n4 0 1 2 3\n";
    let off = "OFF # comment\n4 1 0\n0 0 0\n1 0 0\n\n1 1 0\n0 1 0.5\n4 0 1 2 3\n";
    for (name, text) in [("square.obj", obj), ("square.ply", ascii), ("square.off", off)] {
        let mesh = read(name, text.as_bytes()).unwrap();
        assert_eq!((&mesh.positions, &mesh.faces), (&positions, &faces), "{name}");
    }
    let uv = read("uv.obj", obj.as_bytes()).unwrap().uv.unwrap();
    assert_eq!((uv.coordinates[2], &uv.faces), ([1.0, 1.0], &faces));
    let colours = read("colours.ply", ascii.as_bytes()).unwrap().colours.unwrap();
    assert_eq!((colours[1], colours[3]), ([0.0, 1.0, 0.0], [0.2; 3]));

    // Big endian, doubles, the other name of the list.
    let mut binary = b"ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
        property double z\nelement face 1\nproperty list uint8 uint32 vertex_index\nend_header\n"
        .to_vec();
    for coordinate in positions.iter().flatten() {
        binary.extend(f64::from(*coordinate).to_be_bytes());
    }
    binary.push(4);
    for index in [0_u32, 1, 2, 3] {
        binary.extend(index.to_be_bytes());
    }
    let mesh = read("big.ply", &binary).unwrap();
    assert_eq!((&mesh.positions, &mesh.faces), (&positions, &faces));

    // What we write reads back.
    let path = write("ours.ply", b"");
    write_ply(&path, &positions, &faces, &[[255, 0, 51]; 4]).unwrap();
    let back = read_mesh(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    assert_eq!((back.positions, back.faces, back.colours.unwrap()[2]), (positions, faces, [1.0, 0.0, 0.2]));
}

#[test]
fn damaged_files_are_errors_and_never_a_panic() {
    let square: &[u8] =
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    let off: &[u8] = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let mut state = 1_u64;
    let mut random = move |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    for (name, whole) in [("f.ply", square), ("f.obj", obj), ("f.off", off)] {
        let mut refused = 0;
        for k in 0..600 {
            let mut bytes = whole.to_vec();
            if k < whole.len() {
                bytes.truncate(k);
            } else {
                for _ in 0..=random(3) {
                    let at = random(bytes.len());
                    bytes[at] = random(256) as u8;
                }
            }
            refused += usize::from(read(name, &bytes).is_err());
        }
        assert!(refused > 100, "{name}: only {refused} refused");
    }
}

/// Every mesh of the public collections is either unwrapped into texels or refused with a reason.
#[test]
fn public_meshes_are_painted_or_refused() {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let folder = std::env::var("PAINTCOPTER_DATA").unwrap_or_else(|_| default.into());
    let Ok(collections) = std::fs::read_dir(Path::new(&folder).join("meshes")) else {
        eprintln!("skipped: no meshes in {folder}; set PAINTCOPTER_DATA");
        return;
    };
    let mut files: Vec<PathBuf> = collections
        .flatten()
        .flat_map(|c| std::fs::read_dir(c.path()).into_iter().flatten().flatten())
        .map(|f| f.path())
        .collect();
    // Small ones only: the large are the business of uv-param's own tests.
    files.retain(|f| f.is_file() && std::fs::metadata(f).is_ok_and(|m| m.len() < 250_000));
    let mut outcomes = [0, 0];
    for file in files {
        let Ok(mesh) = read_mesh(&file) else { continue };
        match PaintSurface::new(&mesh, 0.05, &|_| ()) {
            Ok(surface) => {
                outcomes[0] += 1;
                assert!(surface.disk().area() > 0.0);
            }
            Err(error) => {
                outcomes[1] += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    assert!(outcomes[0] > 3 && outcomes[1] > 3, "painted and refused: {outcomes:?}");
}
