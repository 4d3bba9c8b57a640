//! Vector drawings (SVG) as pictures.

use image::{DynamicImage, RgbaImage};
use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Group, Node, Options, Tree, roxmltree};

/// Longer side of the picture, pixels: a millimetre on a surface of 2 m.
const SIDE: f32 = 2048.0;

/// Why a drawing cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DrawingError {
    /// No XML.
    #[error("no SVG: {0}")]
    Xml(#[from] roxmltree::Error),
    /// No drawing.
    #[error("no SVG: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// What would be left out without a word.
    #[error("line {line} has a <{element}>, which is not drawn: {advice}")]
    Unsupported {
        /// The element's name.
        element: String,
        /// Where it begins, from 1.
        line: u32,
        /// The way out.
        advice: &'static str,
    },
    /// More pictures within pictures than a drawing needs.
    #[error("the drawing has more than {most} transparent groups within each other: flatten it, or give it as a PNG")]
    TooDeep {
        /// How many are drawn.
        most: usize,
    },
    /// Coordinates that no drawing needs.
    #[error("the drawing has a shape that reaches more than {most} times its size beyond it: cut it off there")]
    TooFar {
        /// How far is drawn, sizes of the drawing.
        most: f32,
    },
    /// A size without area.
    #[error("the drawing is {width} x {height}: give it a size (viewBox)")]
    Empty {
        /// Width, user units.
        width: f32,
        /// Height, user units.
        height: f32,
    },
}

/// Draws an SVG on white, 2048 pixels on its longer side.
///
/// # Errors
/// What is no SVG, has no size, or holds text or embedded pictures.
pub fn draw_svg(text: &str) -> Result<DynamicImage, DrawingError> {
    let document = roxmltree::Document::parse(text)?;
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        let advice = match node.tag_name().name() {
            "text" => "turn text into paths before (Inkscape: Path, Object to Path)",
            "image" => "give the picture itself to --design",
            _ => continue,
        };
        let line = document.text_pos_at(node.range().start).row;
        return Err(DrawingError::Unsupported { element: node.tag_name().name().into(), line, advice });
    }
    let tree = Tree::from_xmltree(&document, &Options::default())?;
    check_depth(tree.root())?;
    let (width, height) = (tree.size().width(), tree.size().height());
    if !is_within(tree.root(), Transform::identity(), FARTHEST * width.max(height)) {
        return Err(DrawingError::TooFar { most: FARTHEST });
    }
    let scale = SIDE / width.max(height);
    let pixels = |length: f32| (length * scale).round().max(2.0) as u32;
    let empty = || DrawingError::Empty { width, height };
    let mut pixmap = Pixmap::new(pixels(width), pixels(height)).ok_or_else(empty)?;
    pixmap.fill(Color::WHITE);
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixmap.as_mut());
    let (width, height) = (pixmap.width(), pixmap.height());
    // On white nothing is transparent, so that premultiplied colours are the colours.
    RgbaImage::from_raw(width, height, pixmap.take()).map(DynamicImage::ImageRgba8).ok_or_else(empty)
}

/// Groups that are drawn apart (opacity, masks, filters) within each other: each is a picture of its own.
const DEEPEST: usize = 8;

/// Refuses what would take gigabytes; the number of elements is bounded by `usvg`.
fn check_depth(root: &Group) -> Result<(), DrawingError> {
    let mut open = vec![(root, 0)];
    while let Some((group, above)) = open.pop() {
        let apart = above + usize::from(group.should_isolate());
        if apart > DEEPEST {
            return Err(DrawingError::TooDeep { most: DEEPEST });
        }
        let groups = group.children().iter().filter_map(|child| match child {
            Node::Group(group) => Some((group.as_ref(), apart)),
            _ => None,
        });
        open.extend(groups);
    }
    Ok(())
}

/// How far shapes may reach beyond the drawing, in its size. From some 250,000 on the renderer counts pixels beyond 32 bits and stops
/// the program.
const FARTHEST: f32 = 1e4;

/// Whether all shapes lie within so many units of the origin: those that clip, mask and fill others too, which are drawn by the
/// transform of what they belong to.
fn is_within(group: &Group, picture_from_group: Transform, most: f32) -> bool {
    group.children().iter().all(|child| {
        let reach = child.abs_stroke_bounding_box().transform(picture_from_group);
        let sides = reach.map(|reach| [reach.left(), reach.right(), reach.top(), reach.bottom()]);
        let mut within = sides.is_some_and(|sides| sides.iter().all(|side| side.abs() <= most));
        let picture_from_child = picture_from_group.pre_concat(child.abs_transform());
        child.subroots(|root| within &= is_within(root, picture_from_child, most));
        let Node::Group(group) = child else { return within };
        let mut clips = std::iter::successors(group.clip_path(), |clip| clip.clip_path());
        within &= clips.all(|clip| is_within(clip.root(), picture_from_child.pre_concat(clip.transform()), most));
        within && is_within(group, picture_from_group, most)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_lies_where_the_drawing_says() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 20 10">
            <g transform="translate(10 0)"><path d="M 2 5 H 8" stroke="#000" stroke-width="2" fill="none"/></g></svg>"##;
        let picture = draw_svg(svg).unwrap().to_luma8();
        assert_eq!(picture.dimensions(), (2048, 1024));
        let at = |x: f32, y: f32| picture.get_pixel((x * 102.4) as u32, (y * 102.4) as u32).0[0];
        assert_eq!([at(12.5, 5.0), at(17.5, 4.5), at(15.0, 5.8)], [0; 3]);
        assert_eq!([at(11.5, 5.0), at(18.5, 5.0), at(15.0, 3.5), at(15.0, 6.5), at(5.0, 5.0)], [255; 5]);
    }

    #[test]
    fn what_would_be_left_out_is_refused_with_its_line() {
        let svg =
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9 9\">\n<text x=\"1\" y=\"5\">hi</text></svg>";
        let message = draw_svg(svg).unwrap_err().to_string();
        assert!(message.contains("line 2") && message.contains("<text>") && message.contains("paths"), "{message}");
        let svg = svg.replace("text", "image");
        assert!(draw_svg(&svg).unwrap_err().to_string().contains("<image>"));
        for broken in ["", "<svg", "<html/>", "no xml"] {
            assert!(draw_svg(broken).is_err(), "{broken:?}");
        }
    }

    /// The renderer would stop the program: an overflow beyond 2^31 pixels.
    #[test]
    fn shapes_far_beyond_the_drawing_are_refused_wherever_they_serve() {
        let head = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 20">"#;
        let far = r#"<circle cx="9" cy="9" r="999999998"/>"#;
        let rect = r#"<rect x="1" y="2" width="30" height="9""#;
        let drawn = |body: &str| draw_svg(&format!("{head}{body}</svg>"));
        for body in [
            far.to_string(),
            format!(r#"<g opacity="0.5">{far}</g>"#),
            format!(r#"<clipPath id="c">{far}</clipPath><g clip-path="url(#c)">{rect}/></g>"#),
            format!(
                r#"<clipPath id="c" transform="scale(1e8)">{rect}/></clipPath><g clip-path="url(#c)">{rect}/></g>"#
            ),
            format!(r#"<mask id="c">{far}</mask><g mask="url(#c)">{rect}/></g>"#),
            format!(r#"{rect} transform="scale(1e8)"/>"#),
            format!(
                r#"<clipPath id="c">{rect}/></clipPath><g transform="scale(1e8)" clip-path="url(#c)">{rect}/></g>"#
            ),
            format!(r##"{rect} stroke="#000" stroke-width="1e9"/>"##),
        ] {
            assert!(matches!(drawn(&body), Err(DrawingError::TooFar { .. })), "{body}");
        }
        assert!(drawn(r#"<circle cx="9" cy="9" r="9999"/>"#).is_ok(), "a large shape in the background");
    }

    #[test]
    fn pictures_within_pictures_are_bounded() {
        let nested = |depth: usize| {
            let (open, close) =
                ("<g opacity=\"0.9\"><path d=\"M 0 0 H 9\" stroke=\"#000\"/>".repeat(depth), "</g>".repeat(depth));
            draw_svg(&format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9 9\">{open}<path d=\"M 1 1 H 8 V 8\"/>{close}</svg>"
            ))
        };
        assert!(nested(7).is_ok());
        assert!(nested(9).unwrap_err().to_string().contains("within each other"));
    }
}
