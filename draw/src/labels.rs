//! Places of names in a picture: next to the object that they name, and without overlap with other names. A name that
//! has no room there stands farther away, at the end of a thin line.

/// Height of letters, in units of the picture.
pub(crate) const LETTER_HEIGHT: f64 = 12.0;
/// Mean width of a letter, in units of the picture.
const LETTER_WIDTH: f64 = 6.4;

/// A rectangle in the picture.
#[derive(Clone, Copy)]
struct LabelBox {
    /// Left and right edge.
    x: [f64; 2],
    /// Upper and lower edge.
    y: [f64; 2],
}

impl LabelBox {
    /// The area that two rectangles share.
    fn overlap_area(&self, other: &Self) -> f64 {
        let along = |a: [f64; 2], b: [f64; 2]| (a[1].min(b[1]) - a[0].max(b[0])).max(0.0);
        along(self.x, other.x) * along(self.y, other.y)
    }
}

/// The occupied areas of a picture.
pub(crate) struct LabelLayout {
    /// Width and height of the picture.
    sheet: [f64; 2],
    /// Rectangles of symbols; a name may cover a part of one.
    symbols: Vec<LabelBox>,
    /// Rectangles of names; no two names overlap.
    names: Vec<LabelBox>,
}

/// The place of a name.
#[derive(Clone, Copy)]
pub(crate) struct LabelPlace {
    /// Start of the base line.
    pub(crate) at: [f64; 2],
    /// Anchor of the text.
    pub(crate) anchor: &'static str,
    /// Near end of the line to the object, if the name stands farther away.
    pub(crate) leader: Option<[f64; 2]>,
}

impl LabelPlace {
    /// The name as SVG, with the line from its object if it stands farther away. The name must be escaped, the class may
    /// be empty.
    pub(crate) fn paint(&self, object: [f64; 2], name: &str, class: &str) -> String {
        let ([x, y], anchor) = (self.at, self.anchor);
        let line = self.leader.map_or_else(String::new, |[to_x, to_y]| {
            let [from_x, from_y] = object;
            format!("<path class=\"leader\" d=\"M{from_x:.1} {from_y:.1}L{to_x:.1} {to_y:.1}\"/>")
        });
        let class = if class.is_empty() {
            String::new()
        } else {
            format!(" class=\"{class}\"")
        };
        format!(
            "{line}<text{class} x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{LETTER_HEIGHT}\" \
             text-anchor=\"{anchor}\">{name}</text>"
        )
    }
}

/// Distances from the object at which a name is tried. From the third one on, a line leads to it.
const DISTANCES: [f64; 7] = [13.0, 22.0, 34.0, 48.0, 64.0, 82.0, 104.0];
/// Share of a name's area that may cover symbols before a place farther away is tried. By judgement.
const LITTLE: f64 = 0.08;
/// Largest distance without a line.
const NEAR: f64 = 22.0;

impl LabelLayout {
    /// An empty picture.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        Self {
            sheet: [width, height],
            symbols: Vec::new(),
            names: Vec::new(),
        }
    }

    /// Marks the square around a disc as occupied.
    pub(crate) fn occupy(&mut self, [x, y]: [f64; 2], radius: f64) {
        self.symbols.push(LabelBox {
            x: [x - radius, x + radius],
            y: [y - radius, y + radius],
        });
    }

    /// The place of a name with a number of letters next to a point. `None` if all places are occupied.
    pub(crate) fn place_label(&mut self, [x, y]: [f64; 2], letters: usize) -> Option<LabelPlace> {
        let width = LETTER_WIDTH * letters as f64;
        let mut best: Option<(f64, LabelPlace, LabelBox)> = None;
        for away in DISTANCES {
            let slanted = 0.75 * away;
            let ways = [
                (slanted, -slanted, "start"),
                (slanted, slanted + 8.0, "start"),
                (-slanted, -slanted, "end"),
                (-slanted, slanted + 8.0, "end"),
                (away, 4.0, "start"),
                (-away, 4.0, "end"),
                (0.0, -away, "middle"),
                (0.0, away + 9.0, "middle"),
            ];
            for (dx, dy, anchor) in ways {
                let at = [x + dx, y + dy];
                let Some((cost, room)) = self.label_cost(at, anchor, width) else {
                    continue;
                };
                if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    let middle = [0.5 * (room.x[0] + room.x[1]), 0.5 * (room.y[0] + room.y[1])];
                    let near = [
                        x.clamp(room.x[0], room.x[1]),
                        if y > middle[1] { room.y[1] } else { room.y[0] },
                    ];
                    let leader = (away > NEAR).then_some(near);
                    best = Some((cost, LabelPlace { at, anchor, leader }, room));
                }
            }
            // A near place that covers little of a symbol is better than a far one.
            if best
                .as_ref()
                .is_some_and(|(cost, ..)| *cost < LITTLE * width * LETTER_HEIGHT)
            {
                break;
            }
        }
        let (cost, place, room) = best?;
        // A name that would be mostly covered is left out.
        if cost > 0.4 * width * LETTER_HEIGHT {
            return None;
        }
        self.names.push(room);
        Some(place)
    }

    /// The area of symbols that a name would cover, and its rectangle; `None` if it would leave the picture or overlap
    /// another name.
    fn label_cost(&self, [x, y]: [f64; 2], anchor: &str, width: f64) -> Option<(f64, LabelBox)> {
        let left = match anchor {
            "start" => x,
            "end" => x - width,
            _ => x - 0.5 * width,
        };
        let room = LabelBox {
            x: [left, left + width],
            y: [y - 0.8 * LETTER_HEIGHT, y + 0.2 * LETTER_HEIGHT],
        };
        let is_outside =
            room.x[0] < 2.0 || room.x[1] > self.sheet[0] - 2.0 || room.y[0] < 2.0 || room.y[1] > self.sheet[1] - 2.0;
        if is_outside || self.names.iter().any(|other| room.overlap_area(other) > 0.0) {
            return None;
        }
        Some((self.symbols.iter().map(|other| room.overlap_area(other)).sum(), room))
    }
}
