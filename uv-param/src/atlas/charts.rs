//! The charts while they are being made: which face is where, and where its corners lie in the plane.

use crate::disk::Disk;
use crate::surface::{FaceLookup, Surface};

/// A partition of a surface into charts, each with a layout in a plane of its own.
pub(super) struct Charts<'a> {
    pub(super) surface: &'a Surface,
    /// Chart of every face.
    pub(super) chart: Vec<u32>,
    /// Faces of every chart, ascending; empty for charts that became part of another.
    pub(super) members: Vec<Vec<u32>>,
    /// Place of every corner in the plane of its chart, metres; corner `k` of face `f` is `3 f + k`.
    pub(super) corner_uv: Vec<[f64; 2]>,
    /// Half-edges that are cut open although both sides belong to one chart.
    pub(super) cut: Vec<bool>,
    /// Seams that the caller wants.
    pub(super) wanted: Vec<bool>,
    lookup: FaceLookup,
}

impl<'a> Charts<'a> {
    /// No charts.
    pub(super) fn new(surface: &'a Surface, wanted: Vec<bool>) -> Self {
        let faces = surface.faces().len();
        Self {
            surface,
            chart: vec![u32::MAX; faces],
            members: Vec::new(),
            corner_uv: vec![[0.0; 2]; 3 * faces],
            cut: vec![false; 3 * faces],
            wanted,
            lookup: FaceLookup::new(surface),
        }
    }

    /// The faces that hang together with one, across no seam: those that `takes` takes when it is first asked.
    pub(super) fn piece(&self, start: u32, mut takes: impl FnMut(u32) -> bool) -> Vec<u32> {
        let mut piece = vec![start];
        let mut next = 0;
        while let Some(&f) = piece.get(next) {
            next += 1;
            for h in (3 * f as usize..3 * f as usize + 3).filter(|&h| !self.cut[h] && !self.wanted[h]) {
                let other = self.surface.twin(h).map(|twin| (twin / 3) as u32);
                piece.extend(other.filter(|g| takes(*g)));
            }
        }
        piece
    }

    /// Connected pieces of some faces, each all marked or all not; every piece ascending.
    pub(super) fn pieces(&mut self, faces: &[u32], marked: &[bool]) -> Vec<(Vec<u32>, bool)> {
        self.lookup.set(faces);
        let mut seen = vec![false; faces.len()];
        let mut found = Vec::new();
        for (local, &start) in faces.iter().enumerate() {
            if std::mem::replace(&mut seen[local], true) {
                continue;
            }
            let mark = marked[local];
            let takes = |g: u32| {
                let local = self.lookup.get(g as usize).filter(|&local| marked[local] == mark);
                local.is_some_and(|local| !std::mem::replace(&mut seen[local], true))
            };
            let mut piece = self.piece(start, takes);
            piece.sort_unstable();
            found.push((piece, mark));
        }
        self.lookup.clear(faces);
        found
    }

    /// Whether the two sides of an inner edge are apart in the plane.
    pub(super) fn is_seam(&self, h: usize) -> bool {
        self.cut[h]
            || self.wanted[h]
            || self.surface.twin(h).is_some_and(|twin| self.chart[h / 3] != self.chart[twin / 3])
    }

    /// The charts on the two sides of an inner edge: that of the half-edge first.
    pub(super) fn sides(&self, h: usize) -> [u32; 2] {
        let twin = self.surface.twin(h).unwrap_or(h);
        [self.chart[h / 3], self.chart[twin / 3]]
    }

    /// Adds a chart.
    pub(super) fn add(&mut self, faces: Vec<u32>, disk: &Disk, uv: &[[f64; 2]]) -> u32 {
        let name = self.members.len() as u32;
        self.place(&faces, disk, uv);
        for &f in &faces {
            self.chart[f as usize] = name;
        }
        self.members.push(faces);
        name
    }

    /// A new layout of some faces.
    pub(super) fn place(&mut self, faces: &[u32], disk: &Disk, uv: &[[f64; 2]]) {
        for (&f, corners) in faces.iter().zip(&disk.faces) {
            for (k, &v) in corners.iter().enumerate() {
                self.corner_uv[3 * f as usize + k] = uv[v as usize];
            }
        }
    }

    /// Some faces as a surface of their own, open at cuts and wanted seams.
    pub(super) fn disk(&mut self, faces: &[u32]) -> Option<Disk> {
        let (cut, wanted) = (&self.cut, &self.wanted);
        self.surface.disk(faces, |h| cut[h] || wanted[h], &mut self.lookup)
    }

    /// The layout of a chart, one point per vertex of `disk`, which holds these faces.
    pub(super) fn uv(&self, faces: &[u32], disk: &Disk) -> Vec<[f64; 2]> {
        let mut uv = vec![[0.0; 2]; disk.positions.len()];
        for (&f, corners) in faces.iter().zip(&disk.faces) {
            for (k, &v) in corners.iter().enumerate() {
                uv[v as usize] = self.corner_uv[3 * f as usize + k];
            }
        }
        uv
    }

    /// Mean place of every vertex of `disk`, which holds these faces.
    pub(super) fn vertex_uv(
        &self,
        faces: &[u32],
        disk: &Disk,
        moved: impl Fn(usize, [f64; 2]) -> [f64; 2],
    ) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 3]; disk.positions.len()];
        for (&f, corners) in faces.iter().zip(&disk.faces) {
            for (k, &v) in corners.iter().enumerate() {
                let [x, y] = moved(f as usize, self.corner_uv[3 * f as usize + k]);
                let sum = &mut sums[v as usize];
                *sum = [sum[0] + x, sum[1] + y, sum[2] + 1.0];
            }
        }
        sums.iter().map(|&[x, y, count]| [x / count, y / count]).collect()
    }

    /// Puts the corners of the face of half-edge `h` where they lie when it is unfolded over that edge from the face of the twin.
    pub(super) fn unfold(&mut self, h: usize, twin: usize) {
        let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
        let (edge, side) = (self.surface.edge(h), -self.surface.edge(next(next(h))));
        let length = edge.norm();
        let (foot, height) = (edge.dot(&side) / length, edge.cross(&side).norm() / length);
        let (from, to) = (self.corner_uv[next(twin)], self.corner_uv[twin]);
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        let scale = 1.0 / x.hypot(y).max(f64::MIN_POSITIVE);
        let (x, y) = (x * scale, y * scale);
        self.corner_uv[h] = from;
        self.corner_uv[next(h)] = [from[0] + length * x, from[1] + length * y];
        self.corner_uv[next(next(h))] = [from[0] + foot * x - height * y, from[1] + foot * y + height * x];
    }

    /// Areas of all charts, from those of the faces.
    pub(super) fn areas(&self, face_areas: &[f64]) -> Vec<f64> {
        self.members.iter().map(|faces| faces.iter().map(|&f| face_areas[f as usize]).sum()).collect()
    }
}
