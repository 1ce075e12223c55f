//! Places of names in a picture: next to the object that they name, and without overlap with other names and joints.

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
    /// Rectangles that are occupied.
    taken: Vec<LabelBox>,
}

impl LabelLayout {
    /// An empty picture.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        Self {
            sheet: [width, height],
            taken: Vec::new(),
        }
    }

    /// Marks the square around a disc as occupied.
    pub(crate) fn occupy(&mut self, [x, y]: [f64; 2], radius: f64) {
        self.taken.push(LabelBox {
            x: [x - radius, x + radius],
            y: [y - radius, y + radius],
        });
    }

    /// The place of a name with a number of letters next to a point: the start of its base line, and its anchor. `None`
    /// if all places near the point are occupied.
    pub(crate) fn place_label(&mut self, [x, y]: [f64; 2], letters: usize) -> Option<(f64, f64, &'static str)> {
        let width = LETTER_WIDTH * letters as f64;
        let mut best: Option<(f64, (f64, f64, &'static str), LabelBox)> = None;
        // Eight directions at two distances.
        for away in [13.0, 22.0] {
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
            // The place with the least overlap is used; names must be inside the picture.
            for (dx, dy, anchor) in ways {
                let (at_x, at_y) = (x + dx, y + dy);
                let left = match anchor {
                    "start" => at_x,
                    "end" => at_x - width,
                    _ => at_x - 0.5 * width,
                };
                let room = LabelBox {
                    x: [left, left + width],
                    y: [at_y - 0.8 * LETTER_HEIGHT, at_y + 0.2 * LETTER_HEIGHT],
                };
                let is_outside = room.x[0] < 2.0
                    || room.x[1] > self.sheet[0] - 2.0
                    || room.y[0] < 2.0
                    || room.y[1] > self.sheet[1] - 2.0;
                if is_outside {
                    continue;
                }
                let cost: f64 = self.taken.iter().map(|other| room.overlap_area(other)).sum();
                if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    best = Some((cost, (at_x, at_y, anchor), room));
                }
            }
        }
        let (cost, place, room) = best?;
        // A name that would be mostly covered is left out.
        if cost > 0.4 * width * LETTER_HEIGHT {
            return None;
        }
        self.taken.push(room);
        Some(place)
    }
}
