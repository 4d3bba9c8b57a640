//! Every table, figure and equation of the papers: where it stands here, or why nowhere.

use super::table::Table;

/// What is not repeated, and why.
const PHOTO: &str = "no row: a photograph of the robot or its work";
const DESIGN: &str = "no row: a drawing of the system; the chapters have their own";

/// The table, in the order of the papers.
pub fn table() -> Table {
    let mut table = Table::new("papers", &["paper", "what", "here"]);
    for (paper, parts) in PAPERS {
        for [what, here] in *parts {
            table.row([(*paper).into(), (*what).into(), (*here).into()]);
        }
    }
    table
}

/// A paper's parts, each with its place.
type Parts = &'static [[&'static str; 2]];

const PAPERS: &[(&str, Parts)] = &[
    ("thesis", &[["Fig. 1.1", "no row: people at work"]]),
    (
        "Paper I (chapter 5)",
        &[
            ["Figs. 5.1; 5.6", PHOTO],
            ["Fig. 5.2", DESIGN],
            ["Fig. 5.3", "[regions and levels](tsdf-hash.md#memory-hierarchy)"],
            ["Eqs. (5.1) to (5.3)", "[tracker](tsdf-hash.md#tracking)"],
            ["Fig. 5.4; Eqs. (5.4) to (5.6)", "[incremental ray cast; corrected](tsdf-hash.md#incremental-ray-cast)"],
            ["Fig. 5.5", "[drift before and after](results.md#loops-and-relocalisation)"],
            ["Table 5.1", "[rendered sequences like these](results.md#tracking); its own are not published"],
            ["Fig. 5.7; Fig. 5.8", "[active memory and times of ours](results.md#tsdf-hash); not its GPU"],
            ["Fig. 5.9; Table 5.2", "[of `fast` and of other recordings](results.md#tracking)"],
            ["Fig. 5.10", "[mesh against the true surface](results.md#tsdf-hash)"],
        ],
    ),
    (
        "Paper II (chapter 6)",
        &[
            ["Figs. 6.1; 6.2; 6.11", PHOTO],
            ["Fig. 6.3; Eq. (6.1)", "[kinematics](ptu-kinematics.md)"],
            ["Figs. 6.4; 6.5; 6.7", DESIGN],
            ["Fig. 6.6", "[without smoothing](results.md#the-flights-of-paper-ii)"],
            ["Fig. 6.8", "[localised by itself](results.md#localised-by-itself)"],
            ["Fig. 6.9", "[the flights of Paper II](results.md#the-flights-of-paper-ii)"],
            ["Fig. 6.10", "[without a model](results.md#the-flights-of-paper-ii)"],
        ],
    ),
    (
        "VR letter (chapter 7; its Fig. 1 is the thesis' 7.1 and so on)",
        &[
            ["Figs. 7.1; 7.9", PHOTO],
            ["Figs. 7.2; 7.7", "[planners](results.md#paint-planner)"],
            ["Fig. 7.3; Eqs. (7.1) to (7.6)", "[equation to code](paint-planner.md#equation-to-code)"],
            ["Eq. (7) of the letter", "[corrected](paint-planner.md#equation-to-code)"],
            ["Fig. 7.4", "[time allocation](results.md#paint-planner)"],
            ["Fig. 7.5", "[contour](results.md#painting-by-hand-the-vr-interface)"],
            ["Fig. 7.6", "[latency](results.md#painting-by-hand-the-vr-interface)"],
            ["Fig. 7.8", "[layers](results.md#painting-by-hand-the-vr-interface) of published pigments; no printer"],
        ],
    ),
    (
        "Paper IV (chapter 8)",
        &[
            ["Fig. 8.1", DESIGN],
            ["Fig. 8.2", "no row: its models and textures; ours are built in"],
            ["Eq. (8.1)", "[nozzle of a texel](uv-param.md#equation-to-item)"],
            ["Fig. 8.3", "[in layers](thesis-network.md#comparison-with-the-feedback-network)"],
            ["Fig. 8.4", "[without a stop](results.md#thesis-network)"],
            ["Fig. 8.5; Table 8.1; Algorithm 3", "[the network](thesis-network.md)"],
            ["Figs. 8.6; 8.8", "[films](thesis-network.md#training)"],
            ["Fig. 8.7", "[trainings; volumes](results.md#thesis-network)"],
            ["Fig. 8.9", "[on a wall](thesis-network.md#in-missions); [figures](results.md#one-flight-or-layers)"],
        ],
    ),
    (
        "handheld paper",
        &[
            ["Figs. 1; 6", PHOTO],
            ["Fig. 2", "[density and path](handheld.md#one-decision)"],
            ["Figs. 3; 4; Eqs. (1) to (7)", "[one decision](handheld.md#one-decision)"],
            ["Table I; Fig. 5; Fig. 7", "[figures](results.md#handheld-gantry-robot)"],
        ],
    ),
];
