//! The picture of the page: how long one Panda takes, as bars of equal scale within each function.

use std::fmt::Write as _;

use crate::Figures;
use crate::peers::GENERATORS;

const WIDTH: f64 = 760.0;
/// Where bars begin, and how long the longest is.
const LEFT: f64 = 210.0;
const LONGEST: f64 = 440.0;
const LINE: f64 = 24.0;

/// A bar for every contestant that has a time, in an SVG that stands by itself.
pub(crate) fn bars(panda: &Figures) -> String {
    let (mut body, mut top) = (String::new(), 56.0);
    for function in ["inverse dynamics", "regressor"] {
        let ours = [
            ("blocks", "modelmill, blocks"),
            ("blocks, 256 bits", "modelmill, 256 bits"),
            ("one state", "modelmill, one state"),
            ("scalar", "modelmill, scalar"),
        ];
        let peers = GENERATORS.iter().copied().chain(["Pinocchio"]);
        let all = ours.into_iter().chain(peers.map(|p| (p, p)));
        let rows: Vec<(&str, f64)> = all
            .filter_map(|(who, label)| Some((label, panda.time(who, function)?)))
            .collect();
        let longest = rows.iter().fold(0.0_f64, |m, (_, ns)| m.max(*ns));
        _ = writeln!(
            body,
            r#"<text x="{LEFT}" y="{top}" font-weight="bold">{function}, ns per state</text>"#
        );
        top += 12.0;
        for (label, ns) in rows {
            let (middle, length) = (top + 0.65 * LINE, (LONGEST * ns / longest).max(1.0));
            let colour = if label.starts_with("modelmill") {
                "#1f5fa8"
            } else {
                "#9aa4ad"
            };
            _ = writeln!(
                body,
                r#"<text x="{:.1}" y="{middle:.1}" text-anchor="end">{label}</text>
<rect x="{LEFT}" y="{:.1}" width="{length:.1}" height="{:.1}" fill="{colour}"/>
<text x="{:.1}" y="{middle:.1}">{ns:.0}</text>"#,
                LEFT - 8.0,
                top + 0.1 * LINE,
                0.7 * LINE,
                LEFT + length + 6.0,
            );
            top += LINE;
        }
        top += 30.0;
    }
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {:.0}" font-family="sans-serif" font-size="13">
<rect width="100%" height="100%" fill="#fff"/>
<text x="{LEFT}" y="26" font-size="17">Franka Panda, one run on one core</text>
{body}</svg>
"##,
        top - 20.0
    )
}
