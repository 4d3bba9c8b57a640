//! Reads the chain from a URDF file: body - (fixed) - pan - (fixed) - tilt - (fixed) - nozzle.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

use crate::error::Error;
use crate::settings::{Ptu, PtuSettings, Range};

/// How the URDF's joint angles map to ours: multiply by the sign. Pan is positive to the left, tilt is positive upwards;
/// a URDF whose tilt axis is `+y` counts downwards and gets -1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UrdfJointSigns {
    /// +1 or -1.
    pub pan: f64,
    /// +1 or -1.
    pub tilt: f64,
}

/// Axes closer than this to parallel count as parallel.
const PARALLEL: f64 = 1e-6;

impl Ptu {
    /// Builds the chain that ends at link `nozzle_link`, whose x axis is the spray axis. Walking from the root link,
    /// the first moving joint is pan (axis ±z of the body), the second tilt (axis ±y of the panned frame); everything
    /// else must be fixed. Limits come from the joints' `<limit lower= upper=>`; a continuous joint keeps ±π (pan).
    pub fn from_urdf(text: &str, nozzle_link: &str) -> Result<(Self, UrdfJointSigns), Error> {
        let document = Document::parse(text).map_err(|e| fault("document", e.to_string()))?;
        let chain = chain_to(&document, nozzle_link)?;
        let moving: Vec<usize> = (0..chain.len()).filter(|&k| chain[k].axis.is_some()).collect();
        let [pan_at, tilt_at] = moving[..] else {
            return Err(fault(nozzle_link, format!("{} moving joints lead here, expected pan and tilt", moving.len())));
        };
        let product =
            |joints: &[Joint]| joints.iter().fold(Isometry3::identity(), |pose, j| pose * j.parent_from_child);
        let body_from_pan = product(&chain[..=pan_at]);
        let pan_from_tilt = product(&chain[pan_at + 1..=tilt_at]);
        let tilt_from_nozzle = product(&chain[tilt_at + 1..]);
        let (pan, tilt) = (&chain[pan_at], &chain[tilt_at]);

        // At zero joint angles all our frames are parallel to the body: rotate everything there once.
        let pan_axis = body_from_pan.rotation * pan.axis.unwrap_or_default();
        let tilt_axis = body_from_pan.rotation * pan_from_tilt.rotation * tilt.axis.unwrap_or_default();
        let pan_sign = sign_along(&pan_axis, &Vector3::z(), &pan.name, "pan must turn about the body's z axis")?;
        let tilt_sign = sign_along(&tilt_axis, &-Vector3::y(), &tilt.name, "tilt must turn about the body's y axis")?;
        let body_from_nozzle = body_from_pan * pan_from_tilt * tilt_from_nozzle;
        let spray = body_from_nozzle.rotation * Vector3::x();
        if spray.y.abs() > PARALLEL {
            return Err(fault(
                nozzle_link,
                "its x axis (the spray) must lie in the body's xz plane at zero angles".into(),
            ));
        }
        let settings = PtuSettings {
            body_from_pan_axis: body_from_pan.translation.vector,
            pan_from_tilt_axis: body_from_pan.rotation * pan_from_tilt.translation.vector,
            tilt_from_tip: body_from_pan.rotation * pan_from_tilt.rotation * tilt_from_nozzle.translation.vector,
            gun_pitch: spray.z.atan2(spray.x),
            pan_limits: pan.limits(pan_sign).unwrap_or(Range::symmetric(std::f64::consts::PI)),
            tilt_limits: tilt.limits(tilt_sign).unwrap_or(Range::symmetric(std::f64::consts::FRAC_PI_2)),
        };
        Ok((Self::new(settings)?, UrdfJointSigns { pan: pan_sign, tilt: tilt_sign }))
    }
}

/// One joint of the chain; `axis` (in the child frame) is `None` where it is fixed.
struct Joint {
    name: String,
    parent_from_child: Isometry3<f64>,
    axis: Option<Vector3<f64>>,
    lower_upper: Option<[f64; 2]>,
}

impl Joint {
    fn limits(&self, sign: f64) -> Option<Range> {
        let [lower, upper] = self.lower_upper?;
        Some(if sign > 0.0 { Range { min: lower, max: upper } } else { Range { min: -upper, max: -lower } })
    }
}

/// The joints from the root link to `tip`, in that order.
fn chain_to(document: &Document, tip: &str) -> Result<Vec<Joint>, Error> {
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

fn read_joint(node: Node) -> Result<Joint, Error> {
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
    Ok(Joint { name, parent_from_child: Isometry3::from_parts(Translation3::from(xyz), rotation), axis, lower_upper })
}

fn sign_along(axis: &Vector3<f64>, expected: &Vector3<f64>, joint: &str, rule: &str) -> Result<f64, Error> {
    let along = axis.dot(expected);
    if 1.0 - along.abs() > PARALLEL { Err(fault(joint, rule.into())) } else { Ok(along.signum()) }
}

fn fault(place: &str, what: String) -> Error {
    Error::Urdf { place: place.to_string(), what }
}
