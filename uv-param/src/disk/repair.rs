//! From a triangle soup to a [`Disk`], with an account of what was left out.

use super::surface::Disk;
use crate::error::Error;
use crate::half_edges::{BORDER, EdgeTable, boundary_loops, fans, half_edge};
use crate::polygon_soup::{check, faces_with_shape, find_root, weld};
use crate::triangle;

/// What [`largest_disk_with`] may change in the mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Repair {
    /// Merge vertices at exactly the same position. Files often split vertices along texture seams or store three
    /// vertices per face; without welding such a mesh falls apart. Off by default.
    pub weld: bool,
    /// Give each fan of faces around a non-manifold vertex a vertex of its own; the surface itself does not change. Off
    /// by default.
    pub split_vertices: bool,
}

/// What [`largest_disk`] found and left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct RepairReport {
    /// Edge-connected parts of the mesh (after dropping degenerate faces).
    pub components: usize,
    /// Faces of the parts that were not kept.
    pub faces_in_other_components: usize,
    /// Area of the parts that were not kept, m^2.
    pub area_in_other_components_m2: f64,
    /// Vertices that no face uses.
    pub unreferenced_vertices: usize,
    /// Faces with a repeated corner or without area.
    pub degenerate_faces_dropped: usize,
    /// Faces with the same three corners as an earlier one.
    pub duplicate_faces_dropped: usize,
    /// Vertices merged into another at the same position.
    pub welded_vertices: usize,
    /// Vertices added to separate the fans of non-manifold vertices.
    pub split_vertices: usize,
    /// Faces whose winding disagreed with the rest and was reversed.
    pub reversed_faces: usize,
    /// Boundary loops of the disk.
    pub boundary_loops: usize,
}

/// The part of a mesh with the largest area as a [`Disk`]: unreferenced vertices, repeated and zero-area faces are
/// dropped, inconsistent winding is made to agree with the larger side. Positions in metres.
///
/// # Errors
/// Names the vertex, edge or face when the mesh is empty, not finite, or the kept part is not a disk (possibly with
/// holes); see [`Error`] for the way out of each.
pub fn largest_disk(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<(Disk, RepairReport), Error> {
    largest_disk_with(positions, faces, Repair::default())
}

/// As [`largest_disk`], with a choice of repairs.
pub fn largest_disk_with(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    repair: Repair,
) -> Result<(Disk, RepairReport), Error> {
    let mut report = RepairReport { unreferenced_vertices: check(positions, faces)?, ..RepairReport::default() };
    let mut soup: Vec<[u32; 3]> = faces.to_vec();
    if repair.weld {
        report.welded_vertices = weld(positions, &mut soup);
    }
    let shaped = faces_with_shape(positions, &soup);
    (report.degenerate_faces_dropped, report.duplicate_faces_dropped) = (shaped.degenerate, shaped.duplicate);
    let mut kept = shaped.kept;
    if kept.is_empty() {
        return Err(Error::ZeroArea);
    }
    let mut oriented: Vec<[u32; 3]> = kept.iter().map(|&f| soup[f as usize]).collect();
    let mut table = EdgeTable::new(positions.len(), &oriented);
    let chosen = largest_component(positions, &oriented, &table, &mut report);
    if chosen.len() < kept.len() {
        oriented = chosen.iter().map(|&f| oriented[f as usize]).collect();
        kept = chosen.iter().map(|&f| kept[f as usize]).collect();
        table = EdgeTable::new(positions.len(), &oriented);
    }
    let (mut twins, reversed) = orient(positions, &mut oriented, &table, &kept)?;
    report.reversed_faces = reversed.iter().filter(|&&r| r).count();
    let vertex_source = separate_fans(&mut oriented, &twins, positions.len(), repair, &mut report)?;

    let loops = boundary_loops(vertex_source.len(), &oriented, &twins);
    report.boundary_loops = loops.len();
    check_topology(vertex_source.len(), &twins, loops.len())?;
    let positions_kept: Vec<[f64; 3]> = vertex_source.iter().map(|&v| positions[v as usize]).collect();
    twins.shrink_to_fit();
    let mut disk = Disk {
        positions: positions_kept,
        faces: oriented,
        vertex_source,
        face_source: kept,
        reversed,
        glued: twins.clone(),
        twins,
        copies: Vec::new(),
        cuts: 0,
        loops,
        source_vertices: positions.len(),
        source_faces: faces.len(),
    };
    disk.sort_loops();
    Ok((disk, report))
}

/// Faces of the edge-connected part with the largest area.
fn largest_component(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    table: &EdgeTable,
    report: &mut RepairReport,
) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..faces.len() as u32).collect();
    for group in table.groups() {
        for &h in &group[1..] {
            let (a, b) = (find_root(&mut parent, group[0] / 3), find_root(&mut parent, h / 3));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut areas = vec![0.0; faces.len()];
    for (f, corners) in faces.iter().enumerate() {
        let area = 0.5 * triangle::cross(corners.map(|v| positions[v as usize])).norm();
        areas[find_root(&mut parent, f as u32) as usize] += area;
    }
    // Roots are the smallest faces of their parts, so the first of equal areas is the part that comes first.
    let largest = (0..faces.len()).fold(0, |best, f| if areas[f] > areas[best] { f } else { best });
    report.components = areas.iter().filter(|&&a| a > 0.0).count();
    report.area_in_other_components_m2 =
        areas.iter().enumerate().filter(|&(f, _)| f != largest).map(|(_, area)| area).sum();
    let chosen: Vec<u32> = (0..faces.len() as u32).filter(|&f| find_root(&mut parent, f) as usize == largest).collect();
    report.faces_in_other_components = faces.len() - chosen.len();
    chosen
}

/// Makes the winding consistent and pairs the half-edges: (twins, reversed).
fn orient(
    positions: &[[f64; 3]],
    faces: &mut [[u32; 3]],
    table: &EdgeTable,
    source: &[u32],
) -> Result<(Vec<u32>, Vec<bool>), Error> {
    let mut twins = vec![BORDER; 3 * faces.len()];
    for group in table.groups() {
        if let &[h, g] = group {
            twins[h as usize] = g;
            twins[g as usize] = h;
        } else if group.len() > 2 {
            let (a, b) = half_edge(faces, group[0] as usize);
            return Err(Error::NonManifoldEdge { a, b, faces: group.len() });
        }
    }
    // Two neighbours agree when they run along their common edge in opposite directions.
    let mut reversed: Vec<Option<bool>> = vec![None; faces.len()];
    reversed[0] = Some(false);
    let mut queue = vec![0usize];
    while let Some(f) = queue.pop() {
        for (h, &twin) in twins.iter().enumerate().skip(3 * f).take(3) {
            if twin == BORDER {
                continue;
            }
            let other = twin as usize;
            let same_direction = half_edge(faces, h).0 == half_edge(faces, other).0;
            let wanted = reversed[f].map(|r| r ^ same_direction);
            let g = other / 3;
            if reversed[g].is_none() {
                reversed[g] = wanted;
                queue.push(g);
            } else if reversed[g] != wanted {
                return Err(Error::NotOrientable { face: source[g] });
            }
        }
    }
    let mut reversed: Vec<bool> = reversed.into_iter().map(|r| r == Some(true)).collect();
    // The side with more area is right.
    let signed: f64 = faces
        .iter()
        .zip(&reversed)
        .map(|(face, &r)| triangle::cross(face.map(|v| positions[v as usize])).norm() * if r { -1.0 } else { 1.0 })
        .sum();
    if signed < 0.0 {
        for r in &mut reversed {
            *r = !*r;
        }
    }
    let moved = |h: u32| if reversed[h as usize / 3] { h / 3 * 3 + 2 - h % 3 } else { h };
    let mut moved_twins = vec![BORDER; twins.len()];
    for (h, &twin) in twins.iter().enumerate() {
        moved_twins[moved(h as u32) as usize] = if twin == BORDER { BORDER } else { moved(twin) };
    }
    for (face, _) in faces.iter_mut().zip(&reversed).filter(|(_, r)| **r) {
        face.swap(1, 2);
    }
    Ok((moved_twins, reversed))
}

/// Renumbers the corners so that each fan of faces has one vertex; returns the source vertex of each new one.
fn separate_fans(
    faces: &mut [[u32; 3]],
    twins: &[u32],
    vertices: usize,
    repair: Repair,
    report: &mut RepairReport,
) -> Result<Vec<u32>, Error> {
    let (fan_of_corner, fan_source) = fans(faces, twins);
    let mut seen = vec![false; vertices];
    for &vertex in &fan_source {
        if std::mem::replace(&mut seen[vertex as usize], true) {
            if !repair.split_vertices {
                return Err(Error::NonManifoldVertex { vertex });
            }
            report.split_vertices += 1;
        }
    }
    let mut order: Vec<u32> = (0..fan_source.len() as u32).collect();
    order.sort_by_key(|&fan| (fan_source[fan as usize], fan));
    let mut rank = vec![0u32; order.len()];
    for (new, &fan) in order.iter().enumerate() {
        rank[fan as usize] = new as u32;
    }
    for (corner, &fan) in fan_of_corner.iter().enumerate() {
        faces[corner / 3][corner % 3] = rank[fan as usize];
    }
    Ok(order.iter().map(|&fan| fan_source[fan as usize]).collect())
}

/// Euler: V - E + F = 2 - 2 genus - loops.
fn check_topology(vertices: usize, twins: &[u32], loops: usize) -> Result<(), Error> {
    let faces = twins.len() / 3;
    let border = twins.iter().filter(|&&t| t == BORDER).count();
    let edges = usize::midpoint(twins.len(), border);
    let genus = (2 + edges - vertices - faces - loops) / 2;
    match (genus, loops) {
        (genus, 0) => Err(Error::Closed { genus }),
        (0, _) => Ok(()),
        (genus, boundary_loops) => Err(Error::HigherGenus { genus, boundary_loops }),
    }
}
