//! A chart, or what cuts left of it, in the layout that it has.

use crate::atlas::cut::seam_cost::SeamCosts;
use crate::chart::Chart;
use crate::half_edges::{BORDER, grouped};

/// A chart that may be cut.
pub(super) struct Sheet<'a> {
    chart: &'a Chart,
    /// Cost of every half-edge as a seam.
    costs: Vec<f64>,
    /// Corners at every vertex, in compressed rows.
    corners: (Vec<u32>, Vec<u32>),
    /// Name of the part in which every face is.
    part_of_face: Vec<u32>,
}

/// Edge-connected faces of a sheet.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) sheet: usize,
    pub(super) name: u32,
    /// Ascending.
    pub(super) faces: Vec<u32>,
    /// In the plane, m^2.
    pub(super) area: f64,
    /// The loops around it as half-edges, the longest first.
    pub(super) loops: Vec<Vec<u32>>,
}

fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}

impl<'a> Sheet<'a> {
    /// `members` are the faces of the surface that the chart holds.
    pub(super) fn new(chart: &'a Chart, members: &[u32], costs: &SeamCosts) -> Self {
        let vertices = chart.disk().faces.as_flattened();
        Self {
            chart,
            costs: (0..vertices.len()).map(|h| costs.of(3 * members[h / 3] + h as u32 % 3)).collect(),
            corners: grouped(chart.uv().len(), vertices.iter().enumerate().map(|(h, &v)| (v, h as u32))),
            part_of_face: vec![0; members.len()],
        }
    }

    pub(super) fn chart(&self) -> &Chart {
        self.chart
    }

    /// Cost of a half-edge as a seam; infinite on the border of the surface.
    pub(super) fn cost(&self, h: u32) -> f64 {
        self.costs[h as usize]
    }

    /// Start and end of a half-edge.
    pub(super) fn ends(&self, h: u32) -> [u32; 2] {
        [h, next(h)].map(|h| self.chart.disk().faces[h as usize / 3][h as usize % 3])
    }

    /// Place of a vertex in the chart, metres.
    pub(super) fn at(&self, v: u32) -> [f64; 2] {
        self.chart.uv()[v as usize]
    }

    /// The corners at a vertex, each the half-edge that starts there.
    pub(super) fn corners(&self, v: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|k| self.corners.0[v as usize + k] as usize);
        &self.corners.1[from..to]
    }

    /// Part in which the face of a half-edge is.
    pub(super) fn part(&self, h: u32) -> u32 {
        self.part_of_face[h as usize / 3]
    }

    /// Whether a part lies on both sides of a half-edge.
    pub(super) fn is_inner(&self, h: u32) -> bool {
        let twin = self.twin(h);
        twin != BORDER && self.part(h) == self.part(twin)
    }

    fn twin(&self, h: u32) -> u32 {
        self.chart.disk().twins[h as usize]
    }

    /// The whole chart.
    pub(super) fn whole(&mut self, sheet: usize, name: u32) -> Part {
        self.part_of(sheet, (0..self.part_of_face.len() as u32).collect(), name)
    }

    /// These faces as a part, of which they are from now on.
    pub(super) fn part_of(&mut self, sheet: usize, faces: Vec<u32>, name: u32) -> Part {
        self.mark(&faces, name);
        let mut seen = vec![false; 3 * self.part_of_face.len()];
        let mut loops: Vec<(f64, Vec<u32>)> = Vec::new();
        for start in faces.iter().flat_map(|&f| 3 * f..3 * f + 3).filter(|&h| !self.is_inner(h)) {
            let (mut around, mut h) = (Vec::new(), start);
            while !std::mem::replace(&mut seen[h as usize], true) {
                around.push(h);
                h = next(h);
                while self.is_inner(h) {
                    h = next(self.twin(h));
                }
            }
            if !around.is_empty() {
                loops.push((around.iter().map(|&h| self.length(h)).sum(), around));
            }
        }
        loops.sort_by(|a, b| b.0.total_cmp(&a.0));
        let area = faces.iter().map(|&f| self.area(f)).sum();
        Part { sheet, name, faces, area, loops: loops.into_iter().map(|(_, around)| around).collect() }
    }

    /// Gives faces back to a part, or to another one.
    pub(super) fn mark(&mut self, faces: &[u32], name: u32) {
        for &f in faces {
            self.part_of_face[f as usize] = name;
        }
    }

    /// The pieces into which a part falls along some of its edges, each ascending.
    pub(super) fn fall_apart(&self, part: &Part, cut: &[u32]) -> Vec<Vec<u32>> {
        let mut closed: Vec<u32> = cut.iter().flat_map(|&h| [h, self.twin(h)]).collect();
        closed.sort_unstable();
        let mut seen = vec![false; self.part_of_face.len()];
        let mut found = Vec::new();
        for &start in &part.faces {
            if std::mem::replace(&mut seen[start as usize], true) {
                continue;
            }
            let (mut piece, mut at) = (vec![start], 0);
            while let Some(&f) = piece.get(at) {
                at += 1;
                for h in (3 * f..3 * f + 3).filter(|&h| self.is_inner(h) && closed.binary_search(&h).is_err()) {
                    let other = self.twin(h) / 3;
                    if !std::mem::replace(&mut seen[other as usize], true) {
                        piece.push(other);
                    }
                }
            }
            piece.sort_unstable();
            found.push(piece);
        }
        found
    }

    /// The edges around a part in the chart.
    pub(super) fn rim(&self, part: &Part) -> Vec<[[f64; 2]; 2]> {
        part.loops.iter().flatten().map(|&h| self.ends(h).map(|v| self.at(v))).collect()
    }

    /// Length of a half-edge in the chart.
    fn length(&self, h: u32) -> f64 {
        let [p, q] = self.ends(h).map(|v| self.at(v));
        (p[0] - q[0]).hypot(p[1] - q[1])
    }

    fn area(&self, f: u32) -> f64 {
        let [a, b, c] = self.chart.disk().faces[f as usize].map(|v| self.at(v));
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    }
}
