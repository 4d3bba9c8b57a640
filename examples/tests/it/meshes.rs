//! Reading meshes: the same surface in every format, and the broken ones of public collections without a panic.

use std::fmt::Write as _;
use std::path::PathBuf;

use paintcopter::mesh_io::{MeshError, PlyMesh, TriangleMesh, read_mesh, write_ply};
use paintcopter::surface::PaintSurface;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

use crate::gltf_meshes::triangle_glb;
use crate::recorded::recorded;

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

    // What is written reads back, and is the header that other programs expect.
    let path = write("ours.ply", b"");
    let colours = [[255, 0, 51]; 4];
    write_ply(&path, &PlyMesh { positions: &positions, normals: None, colours: &colours, faces: &faces }).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let header = "ply\nformat binary_little_endian 1.0\ncomment units: m\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                  property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n\
                  property list uchar int vertex_indices\nend_header\n";
    assert!(bytes.starts_with(header.as_bytes()) && bytes.len() == header.len() + 4 * 15 + 2 * 13);
    let back = read_mesh(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    assert_eq!((back.positions, back.faces, back.colours.unwrap()[2]), (positions, faces, [1.0, 0.0, 0.2]));
}

/// Small files of every format, cut off at every byte and changed at random: thousands of cases, an error or a mesh for each.
#[test]
fn damaged_files_are_errors_and_never_a_panic() {
    let header = "property float x\nproperty float y\nproperty float z\nelement face 1\n\
                  property list uchar int vertex_indices\nend_header\n";
    let ascii = format!("ply\nformat ascii 1.0\nelement vertex 3\n{header}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").into_bytes();
    let mut binary = format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{header}").into_bytes();
    for coordinate in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        binary.extend(coordinate.to_le_bytes());
    }
    binary.push(3);
    binary.extend([0_i32, 1, 2].into_iter().flat_map(i32::to_le_bytes));
    let obj =
        b"# gr\xfcn\r\nv 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 0 1 0 0 0 1\r\nvt 0 0\r\nf 1/1 -2/1 3/-1/1\r\n".to_vec();
    let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec();
    let mut random = SplitMix64::seed_from_u64(1);
    let mut below = move |n: usize| (random.next_u64() % n as u64) as usize;
    for (name, whole) in
        [("ascii.ply", ascii), ("binary.ply", binary), ("f.obj", obj), ("f.off", off), ("f.glb", triangle_glb())]
    {
        assert_eq!(read(name, &whole).unwrap().faces, [[0, 1, 2]], "{name}");
        let mut refused = 0;
        for k in 0..1000 {
            let mut bytes = whole.clone();
            if k < whole.len() {
                bytes.truncate(k);
            } else {
                for _ in 0..=below(3) {
                    let at = below(bytes.len());
                    match below(3) {
                        0 => bytes[at] = below(256) as u8,
                        // Digits and signs are what makes indices and counts absurd.
                        1 => bytes[at] = b"0123456789-"[below(11)],
                        _ => drop(bytes.splice(at..at, *b"99999999")),
                    }
                }
            }
            refused += usize::from(read(name, &bytes).is_err());
        }
        assert!(refused > 100, "{name}: only {refused} refused");
    }
}

/// What files of other programs hold: groups, polygons, line ends of other systems, and very long lines.
#[test]
fn an_obj_of_any_program_is_one_connected_mesh() {
    let square = "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nvt 0 0\r\nvt 1 1\r\n";
    let grouped = format!("mtllib a.mtl\r\no one\r\n{square}g a\r\nusemtl x\r\nf 3 2 1\r\ng b\r\ns off\r\nf 1 4 3\r\n");
    let mesh = read("groups.obj", grouped.as_bytes()).unwrap();
    assert_eq!(
        (mesh.positions.len(), &mesh.faces[..]),
        (4, &[[2, 1, 0], [0, 3, 2]][..]),
        "nothing torn, nothing renumbered"
    );
    // Some corners without texture coordinates: then there are none.
    let partial = format!("{square}f 1/1 2/2 3/2\nf 1 3 4\n");
    assert_eq!(read("partial.obj", partial.as_bytes()).unwrap().uv, None);
    for (face, words) in [
        ("f 1/-9 2/1 3/1", ["line 7", "1/-9"]),
        ("f 1/1 2/0 3/1", ["line 7", "2/0"]),
        ("f 0 1 2", ["line 7", "0"]),
        ("f 1 2 -5", ["line 7", "-5"]),
        ("f 1 2 99999999999999999999", ["line 7", "integer"]),
        ("f 1 2", ["line 7", "2 corners"]),
    ] {
        let error = read("bad.obj", format!("{square}{face}\n").as_bytes()).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{face}: {error}");
    }
    // A polygon of 100,000 corners on one line, and 100,000 lines.
    let mut text = String::new();
    let corners = 100_000_u32;
    for k in 0..corners {
        let (sin, cos) = (f64::from(k) * 1e-4).sin_cos();
        writeln!(text, "v {cos} {sin} 0").unwrap();
    }
    text.push('f');
    (1..=corners).for_each(|k| write!(text, " {k}").unwrap());
    let mesh = read("polygon.obj", text.as_bytes()).unwrap();
    assert_eq!((mesh.positions.len(), mesh.faces.len()), (100_000, 99_998));
    assert_eq!(mesh.faces[99_997], [0, 99_998, 99_999]);
}

/// Every mesh of the public collections is laid out whole, or refused with a reason.
#[test]
fn public_meshes_are_painted_or_refused() {
    let Some(collections) = recorded("meshes") else { return };
    let collections = std::fs::read_dir(collections).unwrap();
    let mut files: Vec<PathBuf> = collections
        .flatten()
        .flat_map(|c| std::fs::read_dir(c.path()).into_iter().flatten().flatten())
        .map(|f| f.path())
        .collect();
    // Small ones only: the large are the business of uv-param's own tests.
    files.retain(|f| f.is_file() && std::fs::metadata(f).is_ok_and(|m| m.len() < 250_000));
    let mut painted = 0;
    for file in files {
        let Ok(mesh) = read_mesh(&file) else { continue };
        match PaintSurface::new(&mesh, 0.05, &|_| ()) {
            Ok(surface) => {
                painted += 1;
                let held: f64 = surface.film_texels().0.iter().map(|texel| texel.area).sum();
                let share = held / surface.disk().area();
                assert!((share - 1.0).abs() < 0.01, "{}: its texels hold {share} of its area", file.display());
            }
            Err(error) => assert!(error.to_string().contains(' '), "{}: {error}", file.display()),
        }
    }
    assert!(painted > 3, "{painted} painted");
}
