//! Atlases that are brought up to date.

use uv_param::atlas::{PageTexels, TexelKind, update_atlas};
use uv_param::nalgebra::Vector3;
use uv_param::{Atlas, Error, unwrap_atlas};

use super::{assert_sound, atlas, cube, settings, sphere};
use crate::common::grid;

/// A dent in a sphere of many charts: what is away from it stays to the bit, what is near is laid out again within the bounds.
#[test]
fn charts_that_a_change_does_not_touch_stay_to_the_bit() {
    let mesh = sphere(24);
    let options = settings(0.02);
    let before = atlas(&mesh, 0.02);
    assert!(before.charts().len() > 1);
    // In the middle of the first chart: as far as can be from the faces of the others.
    let middle = |f: u32| mesh.1[f as usize].iter().map(|&v| Vector3::from(mesh.0[v as usize])).sum::<Vector3<f64>>();
    let others: Vec<Vector3<f64>> = before.chart_faces(1).iter().map(|&f| middle(f)).collect();
    let distance = |f: u32| others.iter().map(|p| (p - middle(f)).norm_squared()).fold(f64::INFINITY, f64::min);
    let faces = before.chart_faces(0).iter().copied();
    let centre = middle(faces.max_by(|&f, &g| distance(f).total_cmp(&distance(g))).unwrap()).normalize();
    let dent = |p: [f64; 3], depth: f64| {
        let near = (Vector3::from(p).dot(&centre) - 0.96).max(0.0) / 0.04;
        p.map(|x| x * (1.0 - depth * near))
    };
    let dented = |depth| mesh.0.iter().map(|&p| dent(p, depth)).collect::<Vec<_>>();
    let moved = dented(0.01);
    let same = |f: &[u32; 3]| f.iter().all(|&v| mesh.0[v as usize] == moved[v as usize]);
    let kept_faces = mesh.1.iter().filter(|f| same(f)).count();
    assert!((0.95..0.99).contains(&(kept_faces as f64 / mesh.1.len() as f64)), "{kept_faces} of {}", mesh.1.len());

    let (after, update) = update_atlas(&before.layout(), &moved, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!(update.kept_faces, kept_faces);
    assert!(update.kept_charts > 0 && update.changed_charts > 0, "{update:?}");
    assert_eq!(update.kept_charts + update.changed_charts + update.new_charts, after.charts().len());
    let bits = |atlas: &Atlas, f: usize| {
        let (chart, local) = atlas.chart_of_face(f);
        let uv = atlas.charts()[chart].disk().faces()[local].map(|v| atlas.charts()[chart].uv()[v as usize]);
        (uv.map(|p| p.map(f64::to_bits)), atlas.placements()[chart])
    };
    let untouched = |chart: usize| before.chart_faces(chart).iter().all(|&f| same(&mesh.1[f as usize]));
    let (mut stayed, mut charts) = (0, 0);
    for chart in (0..before.charts().len()).filter(|&c| untouched(c)) {
        for &f in before.chart_faces(chart) {
            assert_eq!(bits(&before, f as usize), bits(&after, f as usize));
            stayed += 1;
        }
        charts += 1;
    }
    assert!(stayed > 0);
    assert_eq!(charts, update.kept_charts);
    // The page grows to the right alone: rows are counted from its top.
    assert!(after.pages()[0][1] == before.pages()[0][1] && after.pages()[0][0] >= before.pages()[0][0]);
    assert_eq!(after.pages()[0][0] - before.pages()[0][0], update.added_columns);
    assert_eq!(apart(&after, options.pack.gutter), 0);
    let (again, _) = update_atlas(&before.layout(), &moved, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(again.layout(), after.layout());
    // One too deep to be laid out with the rest of its chart: that stays where it is, with a hole.
    let (deep, update) = update_atlas(&before.layout(), &dented(0.2), &mesh.1, &[], &options, |_| ()).unwrap();
    assert_sound(&deep);
    assert!(update.changed_charts == 1 && update.new_charts > 0, "{update:?}");
    // All but what the dent cuts off from the rest.
    let as_before = (0..mesh.1.len()).filter(|&f| same(&mesh.1[f]) && bits(&before, f) == bits(&deep, f)).count();
    assert!(as_before * 20 > 19 * kept_faces, "{as_before} of {kept_faces}");
    assert_eq!(apart(&deep, options.pack.gutter), 0);
    // Nothing changed: the same atlas. Nothing left: as if there had been none.
    let (same, update) = update_atlas(&before.layout(), &mesh.0, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(same.layout(), before.layout());
    assert_eq!((update.kept_charts, update.changed_charts, update.new_charts), (before.charts().len(), 0, 0));
    let grown: Vec<[f64; 3]> = mesh.0.iter().map(|p| p.map(|x| 1.5 * x)).collect();
    let (anew, update) = update_atlas(&before.layout(), &grown, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(anew.layout(), unwrap_atlas(&grown, &mesh.1, &[], &options, |_| ()).unwrap().layout());
    assert_eq!(update.kept_charts, 0);
}

/// A small dent in every chart of a box: each is laid out again, and lies on its old texels all the same; the page does not grow.
#[test]
fn charts_that_are_laid_out_again_keep_their_places() {
    let mesh = sphere(40);
    let before = atlas(&mesh, 0.01);
    let options = settings(0.01);
    // One vertex in the middle of each chart moves inwards.
    let inner = |chart: usize| {
        let disk = before.charts()[chart].disk();
        let rim: Vec<[f64; 2]> = (0..3 * disk.faces().len())
            .filter(|&h| disk.twin(h).is_none())
            .map(|h| before.charts()[chart].uv()[disk.faces()[h / 3][h % 3] as usize])
            .collect();
        let room = |p: [f64; 2]| rim.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1])).fold(f64::INFINITY, f64::min);
        let uv = before.charts()[chart].uv();
        let deepest = (0..uv.len()).max_by(|&a, &b| room(uv[a]).total_cmp(&room(uv[b]))).unwrap();
        disk.vertex_source()[deepest] as usize
    };
    let mut moved = mesh.0.clone();
    for v in (0..before.charts().len()).map(inner) {
        moved[v] = moved[v].map(|x| 0.985 * x);
    }
    let (after, update) = update_atlas(&before.layout(), &moved, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!((update.changed_charts, update.kept_charts, update.new_charts), (before.charts().len(), 0, 0));
    assert_eq!(after.pages(), before.pages());
    assert_eq!(apart(&after, options.pack.gutter), 0);
    // All but the faces around the dents lie where they were, most of them to the bit.
    let corners = |atlas: &Atlas, f: usize| {
        let (chart, local) = atlas.chart_of_face(f);
        let uv = atlas.charts()[chart].disk().faces()[local].map(|v| atlas.charts()[chart].uv()[v as usize]);
        uv.map(|at| atlas.placements()[chart].apply(at))
    };
    let mut same = 0;
    for f in 0..mesh.1.len() {
        let (there, here) = (corners(&before, f), corners(&after, f));
        let off = (0..3).map(|k| (there[k][0] - here[k][0]).hypot(there[k][1] - here[k][1])).fold(0.0, f64::max);
        assert!(off < 3.0 * 0.01, "face {f} moved by {off} m");
        same += usize::from(there == here);
    }
    assert!(10 * same > 6 * mesh.1.len(), "{same} of {}", mesh.1.len());
}

/// Faces that go, and faces that come: a hole cut into a sphere, a box set on it, and both files in any order of faces.
#[test]
fn what_comes_and_goes_is_laid_out_again() {
    let mesh = sphere(24);
    let before = atlas(&mesh, 0.02);
    let hole = |f: &[u32; 3]| f.iter().all(|&v| mesh.0[v as usize][0] > 0.97);
    let mut faces: Vec<[u32; 3]> = mesh.1.iter().filter(|f| !hole(f)).copied().collect();
    faces.reverse();
    let (after, update) = update_atlas(&before.layout(), &mesh.0, &faces, &[], &settings(0.02), |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!((update.kept_faces, update.new_charts), (faces.len(), 0));
    assert_eq!(apart(&after, 2), 0);

    let (mut positions, mut faces) = mesh.clone();
    let first = positions.len() as u32;
    let (more, box_faces) = cube(6);
    positions.extend(more.iter().map(|p| [0.3 * p[0] + 2.0, 0.3 * p[1], 0.3 * p[2]]));
    faces.extend(box_faces.iter().map(|f| f.map(|v| v + first)));
    let (after, update) = update_atlas(&before.layout(), &positions, &faces, &[], &settings(0.02), |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!((update.kept_charts, update.changed_charts), (before.charts().len(), 0));
    assert!(update.new_charts > 0 && update.new_charts < 7, "{update:?}");
    assert_eq!(apart(&after, 2), 0);
    // A layout of another scale, or one that is none, is refused.
    let other = update_atlas(&before.layout(), &positions, &faces, &[], &settings(0.03), |_| ());
    assert!(matches!(other, Err(Error::Setting { name: "texel_m", .. })));
    let mut broken = before.layout();
    broken.chart.pop();
    let broken = update_atlas(&broken, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(broken, Err(Error::Length { .. })));
    let mut broken = before.layout();
    broken.chart[0] = 1000;
    let broken = update_atlas(&broken, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(broken, Err(Error::Setting { name: "chart", .. })));
    let mut vast = before.layout();
    vast.pages[0] = [1 << 40, 1 << 40];
    let vast = update_atlas(&vast, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(vast, Err(Error::TooManyTexels { .. })), "pages are not believed before they are counted");
}

/// A wall that loses a strip at each of its sides in turn: what is left of its chart has another corner, and lies where it was.
#[test]
fn what_is_left_of_a_chart_lies_where_it_was() {
    let mesh = grid(12, 8, |s, t| [1.2 * s, 0.0, 0.8 * t]);
    let before = atlas(&mesh, 0.01);
    assert_eq!(before.charts().len(), 1);
    let corners = |atlas: &Atlas, f: usize| {
        let (chart, local) = atlas.chart_of_face(f);
        let uv = atlas.charts()[chart].disk().faces()[local].map(|v| atlas.charts()[chart].uv()[v as usize]);
        uv.map(|at| atlas.placements()[chart].apply(at))
    };
    let gone: [fn([f64; 3]) -> bool; 4] = [|p| p[0] < 0.15, |p| p[0] > 1.05, |p| p[2] < 0.15, |p| p[2] > 0.65];
    for (side, gone) in gone.iter().enumerate() {
        let stays = |f: &usize| mesh.1[*f].iter().all(|&v| !gone(mesh.0[v as usize]));
        let kept: Vec<usize> = (0..mesh.1.len()).filter(stays).collect();
        let faces: Vec<[u32; 3]> = kept.iter().map(|&f| mesh.1[f]).collect();
        assert!(kept.len() < mesh.1.len() && 2 * kept.len() > mesh.1.len());
        let (after, update) = update_atlas(&before.layout(), &mesh.0, &faces, &[], &settings(0.01), |_| ()).unwrap();
        assert_eq!((update.changed_charts, update.new_charts, after.charts().len()), (1, 0, 1));
        for (f, &old) in kept.iter().enumerate() {
            let (there, here) = (corners(&before, old), corners(&after, f));
            let off = (0..3).map(|k| (there[k][0] - here[k][0]).hypot(there[k][1] - here[k][1])).fold(0.0, f64::max);
            assert!(off < 1e-9, "side {side}: face {old} moved by {off} m");
        }
    }
}

/// Pairs of texels of different charts that are nearer to each other than a gutter, by texels whose centres charts cover.
fn apart(atlas: &Atlas, gutter: usize) -> usize {
    let mut too_near = 0;
    for (page, texels) in PageTexels::of(atlas, 0).iter().enumerate() {
        let [width, height] = atlas.pages()[page];
        let owner = |x: usize, y: usize| {
            let k = y * width + x;
            (texels.kinds[k] == TexelKind::Inside)
                .then(|| atlas.chart_of_face(texels.points[k].unwrap().face as usize).0)
        };
        for y in 0..height {
            for x in 0..width {
                let Some(here) = owner(x, y) else { continue };
                for (i, j) in (0..=gutter).flat_map(|i| (0..=gutter).map(move |j| (x + i, y + j))) {
                    too_near += usize::from(i < width && j < height && owner(i, j).is_some_and(|o| o != here));
                }
            }
        }
    }
    too_near
}
