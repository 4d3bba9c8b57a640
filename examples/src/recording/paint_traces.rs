//! Paint as it appears: what the spray has passed over, a few seconds at a time.

use foxglove::messages::{Color, LinePrimitive, SceneEntity, SceneEntityDeletion, SceneUpdate};
use foxglove::messages::{line_primitive, scene_entity_deletion};
use nalgebra::Point3;

use super::messages::point;

/// Seconds of spraying in one trace at most.
const LENGTH: f64 = 5.0;

/// How paint looks that is on its way to the finished picture.
#[derive(Debug, Clone, Copy)]
pub struct PaintStyle {
    /// Width of a trace, metres: that of the spot.
    pub width: f64,
    /// Flow at which a trace is opaque, m³/s.
    pub max_flow: f64,
    /// Its sRGB colour.
    pub colour: [u8; 3],
}

/// Gathers hits with the valve open into lines on the surface.
pub(super) struct PaintTraces {
    style: PaintStyle,
    points: Vec<(Point3<f64>, f64)>,
    begin: f64,
    count: usize,
}

impl PaintTraces {
    pub(super) fn new(style: PaintStyle) -> Self {
        Self { style, points: Vec::new(), begin: 0.0, count: 0 }
    }

    /// Takes where the spray met the surface at a time (s), with which flow; returns the trace that this ends.
    pub(super) fn push(&mut self, time: f64, hit: Option<Point3<f64>>, flow: f64) -> Option<SceneUpdate> {
        let hit = hit.filter(|_| flow > 0.0);
        if self.points.is_empty() {
            self.begin = time;
        }
        self.points.extend(hit.map(|hit| (hit, flow)));
        let full = time - self.begin >= LENGTH;
        if hit.is_some() && !full {
            return None;
        }
        let trace = self.take();
        // The next trace begins where this one ends.
        if let (Some(hit), true) = (hit, full) {
            (self.points, self.begin) = (vec![(hit, flow)], time);
        }
        trace
    }

    /// Goes on with another paint; returns the trace that this ends.
    pub(super) fn change(&mut self, style: PaintStyle) -> Option<SceneUpdate> {
        let trace = self.take();
        self.style = style;
        trace
    }

    /// The trace so far; none below two points.
    pub(super) fn take(&mut self) -> Option<SceneUpdate> {
        let points = std::mem::take(&mut self.points);
        if points.len() < 2 {
            return None;
        }
        self.count += 1;
        let PaintStyle { width, max_flow, colour } = self.style;
        let [r, g, b] = colour.map(|c| f64::from(c) / 255.0);
        let line = LinePrimitive {
            r#type: line_primitive::Type::LineStrip as i32,
            pose: None,
            thickness: width,
            scale_invariant: false,
            points: points.iter().map(|(p, _)| point(*p)).collect(),
            color: None,
            colors: points.iter().map(|(_, flow)| Color { r, g, b, a: (flow / max_flow).clamp(0.05, 1.0) }).collect(),
            indices: Vec::new(),
        };
        let entity = SceneEntity {
            frame_id: "world".into(),
            id: format!("trace-{}", self.count),
            lines: vec![line],
            ..SceneEntity::default()
        };
        Some(SceneUpdate { deletions: Vec::new(), entities: vec![entity] })
    }

    /// Takes all traces away again, when the finished picture takes their place.
    pub(super) fn clear() -> SceneUpdate {
        let deletion =
            SceneEntityDeletion { timestamp: None, r#type: scene_entity_deletion::Type::All as i32, id: String::new() };
        SceneUpdate { deletions: vec![deletion], entities: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_has_the_paints_colour_and_is_as_opaque_as_the_flow() {
        let style = PaintStyle { width: 0.1, max_flow: 2.0, colour: [255, 51, 0] };
        let mut traces = PaintTraces::new(style);
        for (time, flow) in [(0.0, 2.0), (1.0, 1.0), (2.0, 0.02)] {
            assert!(traces.push(time, Some(Point3::new(time, 0.0, 0.0)), flow).is_none());
        }
        let update = traces.push(3.0, None, 0.0).unwrap();
        let line = &update.entities[0].lines[0];
        let colours: Vec<[f64; 4]> = line.colors.iter().map(|c| [c.r, c.g, c.b, c.a]).collect();
        assert_eq!(colours, [1.0, 0.5, 0.05].map(|a| [1.0, 0.2, 0.0, a]));
        assert_eq!((line.points.len(), line.thickness), (3, 0.1));
        assert!(traces.take().is_none());
    }
}
