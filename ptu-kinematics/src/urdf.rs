//! Reads a serial chain of joints from a URDF file.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

use crate::error::Error;
use crate::joints::Range;

/// One joint of the chain; `axis` (in the child frame) is `None` where it is fixed.
pub(crate) struct UrdfJoint {
    pub(crate) name: String,
    pub(crate) parent_from_child: Isometry3<f64>,
    pub(crate) axis: Option<Vector3<f64>>,
    lower_upper: Option<[f64; 2]>,
}

impl UrdfJoint {
    /// Limits of the angle times `sign`; `None` for a continuous joint.
    pub(crate) fn limits(&self, sign: f64) -> Option<Range> {
        let [lower, upper] = self.lower_upper?;
        Some(if sign > 0.0 { Range { min: lower, max: upper } } else { Range { min: -upper, max: -lower } })
    }
}

/// The joints from the root link to the link `tip`, in that order, fixed ones included.
pub(crate) fn read_chain(text: &str, tip: &str) -> Result<Vec<UrdfJoint>, Error> {
    let document = Document::parse(text).map_err(|e| fault("document", e.to_string()))?;
    chain_to(&document, tip)
}

fn chain_to(document: &Document, tip: &str) -> Result<Vec<UrdfJoint>, Error> {
    let joints: Vec<Node> = document.root_element().children().filter(|n| n.has_tag_name("joint")).collect();
    let mut chain = Vec::new();
    let mut link = tip.to_string();
    while let Some(node) = joints.iter().find(|n| link_of(n, "child") == Some(&link)) {
        if chain.len() > joints.len() {
            return Err(fault(&link, "the joints form a loop".into()));
        }
        chain.push(read_joint(*node)?);
        link = link_of(node, "parent")
            .ok_or_else(|| fault(node.attribute("name").unwrap_or("joint"), "it has no <parent link=...>".into()))?
            .to_string();
    }
    if chain.is_empty() {
        return Err(fault(tip, "no joint has this link as its child".into()));
    }
    chain.reverse();
    Ok(chain)
}

fn link_of<'a>(joint: &Node<'a, '_>, which: &str) -> Option<&'a str> {
    joint.children().find(|n| n.has_tag_name(which))?.attribute("link")
}

fn read_joint(node: Node) -> Result<UrdfJoint, Error> {
    let name = node.attribute("name").unwrap_or("unnamed joint").to_string();
    let child = |tag: &str| node.children().find(|n| n.has_tag_name(tag));
    let vector = |n: Option<Node>, attribute: &str, default: Vector3<f64>| -> Result<Vector3<f64>, Error> {
        let Some(text) = n.and_then(|n| n.attribute(attribute)) else { return Ok(default) };
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        match numbers[..] {
            [x, y, z] if [x, y, z].iter().all(|v| v.is_finite()) => Ok(Vector3::new(x, y, z)),
            _ => Err(fault(&name, format!("{attribute}=\"{text}\" must be three finite numbers"))),
        }
    };
    let xyz = vector(child("origin"), "xyz", Vector3::zeros())?;
    let rpy = vector(child("origin"), "rpy", Vector3::zeros())?;
    let kind = node.attribute("type").unwrap_or("");
    let axis = match kind {
        "fixed" => None,
        "revolute" | "continuous" => {
            let axis = vector(child("axis"), "xyz", Vector3::x())?;
            let unit = axis.try_normalize(f64::MIN_POSITIVE);
            Some(unit.ok_or_else(|| fault(&name, "its axis has zero length".into()))?)
        }
        other => return Err(fault(&name, format!("joint type \"{other}\" is not fixed, revolute or continuous"))),
    };
    let lower_upper = if kind == "revolute" {
        let bound = |attribute: &str| -> Result<f64, Error> {
            let text = child("limit").and_then(|n| n.attribute(attribute));
            text.and_then(|t| t.trim().parse::<f64>().ok())
                .filter(|v| v.is_finite())
                .ok_or_else(|| fault(&name, format!("a revolute joint needs <limit {attribute}=...>")))
        };
        Some([bound("lower")?, bound("upper")?])
    } else {
        None
    };
    let rotation = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z);
    Ok(UrdfJoint {
        name,
        parent_from_child: Isometry3::from_parts(Translation3::from(xyz), rotation),
        axis,
        lower_upper,
    })
}

pub(crate) fn fault(place: &str, what: String) -> Error {
    Error::Urdf { place: place.to_string(), what }
}
