//! Charts cut so that they fill the page.

use super::*;
use crate::common::{fixture, grid};

fn cut(mesh: &Mesh, texel_m: f64, utilisation: Option<f64>) -> Atlas {
    let pack = PackSettings { texel_m, utilisation, ..PackSettings::default() };
    unwrap_atlas(&mesh.0, &mesh.1, &[], &AtlasSettings { pack, ..AtlasSettings::default() }, |_| ()).unwrap()
}

/// The squares of a grid of 10 x 10 m for which `keep` holds.
fn flat(keep: impl Fn(f64, f64) -> bool) -> Mesh {
    let (positions, mut faces) = grid(20, 20, |x, y| [10.0 * x, 10.0 * y, 0.0]);
    faces.retain(|face| {
        let middle = [0, 1].map(|k| face.iter().map(|&v| positions[v as usize][k]).sum::<f64>() / 3.0);
        keep(middle[0], middle[1])
    });
    (positions, faces)
}

/// An L with arms of 10 x 2: no box around it is smaller than 10 x 10, and its two arms fill 10 x 4 less 2 x 2.
#[test]
fn an_l_is_cut_into_its_arms() {
    let l = flat(|x, y| x < 2.0 || y < 2.0);
    let [whole, arms] = [None, Some(0.8)].map(|share| cut(&l, 0.02, share));
    let [before, after] = [&whole, &arms].map(AtlasQuality::of);
    assert!(before.charts == 1 && before.utilisation <= 0.36 + 1e-9, "{before:?}");
    assert_sound(&arms);
    assert_distance(&arms, 2);
    assert!(after.charts == 2 && after.utilisation >= 0.8 && after.utilisation <= 0.9, "{after:?}");
    // Straight across an arm, or along the diagonal at the corner.
    assert!(after.seam_length_m >= 2.0 - 1e-9 && after.seam_length_m <= 8.0_f64.sqrt() + 1e-9, "{after:?}");
}

/// The frame of a square: it falls apart through its hole. Four bars of 2 x 8 lie side by side, while the frame takes its 10 x 10.
#[test]
fn a_frame_is_cut_through_its_hole() {
    let frame = flat(|x, y| x.min(10.0 - x).min(y).min(10.0 - y) < 2.0);
    let bars = cut(&frame, 0.02, Some(0.8));
    let q = AtlasQuality::of(&bars);
    assert_sound(&bars);
    assert_distance(&bars, 2);
    assert!(q.charts > 1 && q.utilisation > 0.64 + 0.05, "{q:?}");
}

/// Pieces are the charts that were there without the option, each triangle with the same sides; seams stay seams.
#[test]
fn pieces_cover_the_charts_and_keep_their_layout() {
    for mesh in [sphere(12), fixture("torus.off")] {
        let size = Surface::new(&mesh.0, &mesh.1, true).unwrap().0.area().sqrt();
        let [whole, cut] = [None, Some(0.95)].map(|share| cut(&mesh, size / 300.0, share));
        let [before, after] = [&whole, &cut].map(AtlasQuality::of);
        assert!(after.charts > before.charts && after.utilisation > before.utilisation, "{before:?} {after:?}");
        assert!(after.seam_length_m > before.seam_length_m);
        assert_sound(&cut);
        assert_distance(&cut, 2);
        let surface = cut.surface();
        let corners = |atlas: &Atlas, f: usize| {
            let (chart, local) = atlas.chart_of_face(f);
            let chart = &atlas.charts()[chart];
            chart.disk().faces()[local].map(|v| chart.uv()[v as usize])
        };
        for f in 0..surface.faces().len() {
            let sides = [&whole, &cut].map(|atlas| {
                let at = corners(atlas, f);
                [0, 1, 2].map(|k: usize| {
                    let (p, q) = (at[k], at[(k + 1) % 3]);
                    (p[0] - q[0]).hypot(p[1] - q[1])
                })
            });
            assert!((0..3).all(|k| (sides[0][k] - sides[1][k]).abs() < 1e-12 * size), "{sides:?}");
            // Pieces come from one chart each.
            let (piece, local) = cut.chart_of_face(f);
            assert_eq!(cut.chart_faces(piece)[local] as usize, f);
            let first = cut.chart_faces(piece)[0] as usize;
            assert_eq!(whole.chart_of_face(first).0, whole.chart_of_face(f).0);
        }
    }
}

/// What fills its page already stays as it is, to the bit.
#[test]
fn nothing_is_cut_where_nothing_needs_be() {
    let mesh = sphere(8);
    let [off, on] = [None, Some(0.2)].map(|share| cut(&mesh, 0.02, share).layout());
    assert_eq!(off, on);
}

/// Pieces are charts like others when the surface changes.
#[test]
fn pieces_stay_when_the_surface_does() {
    let mesh = sphere(8);
    let settings = AtlasSettings {
        pack: PackSettings { texel_m: 0.02, utilisation: Some(0.9), ..PackSettings::default() },
        ..AtlasSettings::default()
    };
    let before = cut(&mesh, 0.02, Some(0.9));
    let (after, update) =
        uv_param::atlas::update_atlas(&before.layout(), &mesh.0, &mesh.1, &[], &settings, |_| ()).unwrap();
    assert_eq!(update.kept_charts, before.charts().len());
    assert_eq!(after.layout(), before.layout());
}

/// Charts that point up are cut upright: no piece is turned.
#[test]
fn pieces_stay_upright() {
    let mesh = sphere(8);
    let settings = AtlasSettings {
        pack: PackSettings { texel_m: 0.02, turns: Turns::None, utilisation: Some(0.9), ..PackSettings::default() },
        charts: ChartSettings { up: Some([0.0, 0.0, 1.0]), ..ChartSettings::default() },
    };
    let whole = AtlasSettings { pack: PackSettings { utilisation: None, ..settings.pack }, ..settings };
    let [whole, cut] = [whole, settings].map(|s| unwrap_atlas(&mesh.0, &mesh.1, &[], &s, |_| ()).unwrap());
    assert!(cut.charts().len() > whole.charts().len());
    for f in 0..mesh.1.len() {
        let edge = |atlas: &Atlas| {
            let (chart, local) = atlas.chart_of_face(f);
            let [a, b, _] = atlas.charts()[chart].disk().faces()[local].map(|v| atlas.charts()[chart].uv()[v as usize]);
            [b[0] - a[0], b[1] - a[1]]
        };
        let (p, q) = (edge(&whole), edge(&cut));
        assert!((0..2).all(|k| (p[k] - q[k]).abs() < 1e-12), "{p:?} {q:?}");
    }
}

#[test]
fn shares_that_no_page_can_have_are_refused() {
    let mesh = sphere(4);
    for utilisation in [0.0, 1.0, f64::NAN, -0.5] {
        let pack = PackSettings { texel_m: 0.02, utilisation: Some(utilisation), ..PackSettings::default() };
        let refused = unwrap_atlas(&mesh.0, &mesh.1, &[], &AtlasSettings { pack, ..AtlasSettings::default() }, |_| ());
        assert!(matches!(refused, Err(Error::Setting { name: "utilisation", .. })));
    }
}
