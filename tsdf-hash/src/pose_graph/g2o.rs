//! Pose graphs as g2o's text (Kümmerle et al. 2011): `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT`, `FIX`, and `EDGE_SE3_PRIOR` of an identical
//! sensor. Quaternions are x y z w; the upper triangle of an information matrix comes row by row, the shift before the turn.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix6, Quaternion, Translation3, UnitQuaternion};

use crate::error::Error;
use crate::pose_graph::factors::{BetweenFactor, PriorFactor};
use crate::pose_graph::graph::PoseGraph;
use crate::pose_graph::robust_kernel::RobustKernel;

/// Rows of `(v, ω)` as rows of `(ω, v)`.
const ORDER: [usize; 6] = [3, 4, 5, 0, 1, 2];

impl PoseGraph {
    /// Reads a graph. Poses come in the order of their numbers, which need not follow each other. As GTSAM does, the information is
    /// taken to be that of the turn, radians; g2o itself means half of it.
    ///
    /// # Errors
    /// [`Error::MalformedG2o`], with the line.
    pub fn from_g2o(text: &str) -> Result<Self, Error> {
        let rows = || {
            let lines =
                text.lines().enumerate().map(|(k, line)| Row { line: k + 1, words: line.split_whitespace().collect() });
            lines.filter(|row| row.words.first().is_some_and(|word| !word.starts_with('#')))
        };
        // Vertices first: an edge may stand before what it joins.
        let mut vertices = BTreeMap::new();
        for row in rows().filter(|row| row.words[0] == "VERTEX_SE3:QUAT") {
            row.expect(9)?;
            if vertices.insert(row.number(1)?, row.pose(2)?).is_some() {
                return Err(row.refuse("its number is taken"));
            }
        }
        let numbers: BTreeMap<u64, usize> = vertices.keys().enumerate().map(|(k, number)| (*number, k)).collect();
        let mut graph = Self { poses: vertices.into_values().collect(), ..Self::default() };
        for row in rows() {
            let vertex = |at: usize| {
                let number = row.number(at)?;
                numbers.get(&number).copied().ok_or_else(|| row.refuse(&format!("there is no vertex {number}")))
            };
            match row.words[0] {
                "VERTEX_SE3:QUAT" => {}
                "EDGE_SE3:QUAT" => {
                    row.expect(31)?;
                    graph.betweens.push(BetweenFactor {
                        first: vertex(1)?,
                        second: vertex(2)?,
                        first_from_second: row.pose(3)?,
                        information: row.information(10)?,
                        kernel: RobustKernel::Squared,
                    });
                }
                "EDGE_SE3_PRIOR" => {
                    row.expect(31)?;
                    let (world_from_body, information) = (row.pose(3)?, row.information(10)?);
                    graph.priors.push(PriorFactor { pose: vertex(1)?, world_from_body, information });
                }
                "PARAMS_SE3OFFSET" => {
                    row.expect(9)?;
                    if row.pose(2)? != Isometry3::identity() {
                        return Err(row.refuse("sensors that stand elsewhere than the body are not known"));
                    }
                }
                "FIX" => {
                    for at in 1..row.words.len() {
                        graph.fixed.push(vertex(at)?);
                    }
                }
                other => return Err(row.refuse(&format!("{other} is not known"))),
            }
        }
        Ok(graph)
    }

    /// Writes the graph; poses are numbered as they come. Robust kernels have no place there and are left out.
    pub fn to_g2o(&self) -> String {
        let mut out = String::new();
        let pose = |p: &Isometry3<f64>| {
            let (t, q) = (p.translation.vector, p.rotation.coords);
            format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
        };
        let triangle = |information: &Matrix6<f64>| {
            let entries = (0..6).flat_map(|row| (row..6).map(move |column| (ORDER[row], ORDER[column])));
            entries.fold(String::new(), |text, at| format!("{text} {}", information[at]))
        };
        // Writing to a string cannot fail.
        for (k, p) in self.poses.iter().enumerate() {
            let _ = writeln!(out, "VERTEX_SE3:QUAT {k} {}", pose(p));
        }
        for k in &self.fixed {
            let _ = writeln!(out, "FIX {k}");
        }
        if !self.priors.is_empty() {
            out.push_str("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n");
        }
        for f in &self.priors {
            let _ =
                writeln!(out, "EDGE_SE3_PRIOR {} 0 {}{}", f.pose, pose(&f.world_from_body), triangle(&f.information));
        }
        for f in &self.betweens {
            let (z, information) = (pose(&f.first_from_second), triangle(&f.information));
            let _ = writeln!(out, "EDGE_SE3:QUAT {} {} {z}{information}", f.first, f.second);
        }
        out
    }
}

/// The words of a line, counted from 1.
struct Row<'a> {
    line: usize,
    words: Vec<&'a str>,
}

impl Row<'_> {
    fn refuse(&self, why: &str) -> Error {
        Error::MalformedG2o { line: self.line, why: why.into() }
    }

    fn expect(&self, words: usize) -> Result<(), Error> {
        let found = self.words.len();
        if found == words { Ok(()) } else { Err(self.refuse(&format!("expected {words} words, found {found}"))) }
    }

    fn number(&self, at: usize) -> Result<u64, Error> {
        let word = self.words.get(at).copied().unwrap_or_default();
        word.parse().map_err(|_| self.refuse(&format!("\"{word}\" is no number of a vertex")))
    }

    fn value(&self, at: usize) -> Result<f64, Error> {
        let word = self.words.get(at).copied().unwrap_or_default();
        let value = word.parse().ok().filter(|x: &f64| x.is_finite());
        value.ok_or_else(|| self.refuse(&format!("\"{word}\" is no finite number")))
    }

    fn pose(&self, at: usize) -> Result<Isometry3<f64>, Error> {
        let mut v = [0.0; 7];
        for (k, value) in v.iter_mut().enumerate() {
            *value = self.value(at + k)?;
        }
        let [x, y, z, i, j, k, w] = v;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 0.5);
        let rotation = rotation.ok_or_else(|| self.refuse("its quaternion is far from unit length"))?;
        Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
    }

    fn information(&self, mut at: usize) -> Result<Matrix6<f64>, Error> {
        let mut information = Matrix6::zeros();
        for row in 0..6 {
            for column in row..6 {
                let value = self.value(at)?;
                information[(ORDER[row], ORDER[column])] = value;
                information[(ORDER[column], ORDER[row])] = value;
                at += 1;
            }
        }
        Ok(information)
    }
}
