//! The forms in which regressor and inverse dynamics can be written, and which of them costs least.
//!
//! All forms of a model have the same values. What they cost says who calls: for open chains the expressions as they
//! stand, since lowering finds little in them; for loops the finished programs.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::vector::{self, Turn};
use crate::expr::{ExprId, Graph};
use crate::newton_euler::{
    self, Body, Depths, Element, Inertia, Motion, Side, Spread, Style, Wrench,
};
use crate::regressor::Equations;
use crate::tree::Tree;
use crate::tree::expressions::Monomial;

/// How the columns of a regressor are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColumnForm {
    pub(crate) style: Style,
    pub(crate) depths: Depths,
    /// Moments of inertia about a joint's own axis are written on the fixed side of the joint, and those about x and y
    /// as second moments less that.
    pub(crate) axial: bool,
    /// Links with parallel axes share the axes of what carries the first of them; inertia is turned there.
    pub(crate) fixed_axes: bool,
}

impl ColumnForm {
    /// As in the textbooks: each column by itself, link by link.
    pub(crate) const PLAIN: Self = Self {
        style: Style::PLAIN,
        depths: Depths {
            moments: 0,
            forces: 0,
        },
        axial: false,
        fixed_axes: false,
    };

    /// The wrenches of one product of value 1 among all products whose columns are written.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        equations: &Equations,
        frames: &Frames,
        product: &Monomial,
        products: &[Monomial],
    ) -> Vec<(usize, Side, Wrench)> {
        let bodies: Vec<(usize, Inertia)> = equations
            .inertia
            .of(product)
            .map(|(link, inertia)| (link, *inertia))
            .collect();
        let (tree, motion) = (&frames.tree, &frames.motion);
        let mut wrenches = Vec::new();
        for (link, inertia) in &bodies {
            let only = single_moment(inertia).filter(|_| self.axial);
            match only {
                Some(2) => {
                    let moment = motion.axial_moment(graph, *link);
                    wrenches.push((*link, Side::Fixed, pure(moment)));
                }
                Some(axis) if has_axial_column(equations, *link, products) => {
                    let mut second = [Graph::ZERO; 2];
                    // The moment of inertia about x holds the second moment along y.
                    second[1 - axis] = Graph::ONE;
                    let body = Body {
                        spread: Spread::Flat(second),
                        ..Body::NONE
                    };
                    let body = frames.turned(graph, *link, &body);
                    let flat = motion.wrench(graph, *link, &body);
                    let axial = motion.axial_moment(graph, *link);
                    let less = axial.map(|m| graph.neg(m));
                    let depth = tree.path(Some(*link)).len();
                    if depth <= self.depths.moments {
                        wrenches.push((*link, Side::Moving, flat));
                        wrenches.push((*link, Side::Fixed, pure(less)));
                    } else {
                        let turn = self.style.turn(&tree.links[*link]);
                        let turned = graph.turn_out(turn, &flat.moment);
                        let moment = graph.add_vectors(&[turned, less]);
                        wrenches.push((*link, Side::Fixed, pure(moment)));
                    }
                }
                _ => {
                    let body = frames.turned(graph, *link, &Body::new(inertia));
                    let wrench = motion.wrench(graph, *link, &body);
                    wrenches.push((*link, Side::Moving, wrench));
                }
            }
        }
        wrenches
    }
}

fn pure(moment: vector::Vector) -> Wrench {
    Wrench {
        force: vector::ZERO,
        moment,
    }
}

/// The axis about which an inertia is a moment of inertia of 1, if it is nothing else.
fn single_moment(inertia: &Inertia) -> Option<usize> {
    let mut nonzero = (0..inertia.len()).filter(|i| inertia[*i] != Graph::ZERO);
    let only = nonzero.next()?;
    if nonzero.next().is_some() || inertia[only] != Graph::ONE {
        return None;
    }
    [0, 3, 5]
        .iter()
        .position(|i| Element::Inertia(*i).index() == only)
}

/// Whether one of some products is the moment of inertia of a link about its joint's axis.
fn has_axial_column(equations: &Equations, link: usize, products: &[Monomial]) -> bool {
    products.iter().any(|product| {
        let mut bodies = equations.inertia.of(product);
        let only = bodies.next();
        only.is_some_and(|(l, inertia)| l == link && single_moment(inertia) == Some(2))
            && bodies.next().is_none()
    })
}

/// How the inverse dynamics is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TotalForm {
    pub(crate) style: Style,
    /// Second moments along joint axes are moved to what carries the joint.
    pub(crate) flat: bool,
    /// At the ends of the tree the inertia is turned rather than the motion.
    pub(crate) turn_ends: bool,
    /// As in [`ColumnForm`].
    pub(crate) fixed_axes: bool,
}

impl TotalForm {
    /// As in the textbooks.
    pub(crate) const PLAIN: Self = Self {
        style: Style::PLAIN,
        flat: false,
        turn_ends: false,
        fixed_axes: false,
    };

    /// The wrenches of all links when every product has the value that `value` gives it.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        equations: &Equations,
        frames: &Frames,
        value: &dyn Fn(&Monomial) -> ExprId,
    ) -> Vec<(usize, Side, Wrench)> {
        let inertia = equations.inertia.total(graph, value);
        let mut bodies: BTreeMap<usize, Body> = inertia
            .iter()
            .map(|(link, inertia)| (*link, Body::new(inertia)))
            .collect();
        let (tree, motion) = (&frames.tree, &frames.motion);
        if self.flat {
            newton_euler::flatten_along_axes(graph, &equations.tree, motion, &mut bodies);
        }
        for (link, body) in &mut bodies {
            *body = frames.turned(graph, *link, body);
        }
        newton_euler::wrenches(graph, tree, motion, &bodies, self.turn_ends)
    }
}

/// A change of a form.
type Change<F> = Box<dyn Fn(F) -> F>;
/// Families of changes.
type Pass<F> = Vec<Vec<Change<F>>>;

/// What outputs cost.
pub(crate) type Weigh<'a> = &'a dyn Fn(&mut Graph, &[ExprId]) -> usize;

/// Ways to write equations, one step after the other; a step that does not make them cheaper is taken back.
///
/// `write` gives the outputs of a form; `steps` holds for every pass the families of changes that it tries on the
/// best form before it; the changes of a family go one way, and once they make it worse the rest is not tried.
fn improve<F: Copy>(
    graph: &mut Graph,
    plain: F,
    steps: &[Pass<F>],
    weigh: Weigh<'_>,
    mut write: impl FnMut(&mut Graph, F) -> Result<Vec<ExprId>, DeriveError>,
) -> Result<Vec<ExprId>, DeriveError> {
    let (mut form, mut best) = (plain, write(graph, plain)?);
    let mut least = weigh(graph, &best);
    for pass in steps {
        for family in pass {
            let before = form;
            let mut last = usize::MAX;
            for change in family {
                let changed = change(before);
                let outputs = write(graph, changed)?;
                // Much makes no difference for planar mechanisms, and weighing takes longest.
                if outputs == best {
                    continue;
                }
                let cost = weigh(graph, &outputs);
                if cost < least {
                    (form, best, least) = (changed, outputs, cost);
                }
                if cost > last {
                    break;
                }
                last = cost;
            }
        }
    }
    Ok(best)
}

/// The frames that have been written already.
#[derive(Default)]
struct Written(Vec<((Style, bool), Frames)>);

impl Written {
    fn of(
        &mut self,
        graph: &mut Graph,
        equations: &Equations,
        gravity: &vector::Vector,
        key: (Style, bool),
    ) -> &Frames {
        let at = self.0.iter().position(|(k, _)| *k == key);
        let at = at.unwrap_or_else(|| {
            let frames = Frames::new(graph, &equations.tree, gravity, key.0, key.1);
            self.0.push((key, frames));
            self.0.len() - 1
        });
        &self.0[at].1
    }
}

/// The passes of the recursions, by name, in the order in which they are tried.
pub(crate) const PASSES: [&str; 5] = [
    "parallel axes at once, or in axes that do not turn",
    "acceleration of a joint's axis from its parent",
    "offsets along an axis behind its joint",
    "moments about a joint's axis on its fixed side",
    "inertia turned rather than motion, forces read off in one frame",
];

/// The frames in which a form is written, and how they move.
pub(crate) struct Frames {
    pub(crate) tree: Tree,
    /// How the axes of every link are turned there; nothing for the links' own axes.
    turns: Vec<Turn>,
    pub(crate) motion: Motion,
}

impl Frames {
    pub(crate) fn new(
        graph: &mut Graph,
        tree: &Tree,
        gravity: &vector::Vector,
        style: Style,
        fixed_axes: bool,
    ) -> Self {
        let (tree, turns) = if fixed_axes {
            tree.in_fixed_axes(graph)
        } else {
            (tree.clone(), Vec::new())
        };
        let motion = newton_euler::forward(graph, &tree, gravity, style);
        Self {
            tree,
            turns,
            motion,
        }
    }

    pub(crate) fn turned(&self, graph: &mut Graph, link: usize, body: &Body) -> Body {
        match self.turns.get(link) {
            Some(turn) => body.turned(graph, turn),
            None => *body,
        }
    }
}

/// The columns of some products, each by its drives, in the form that costs least after the first `n_passes` passes.
pub(crate) fn columns(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    products: &[Monomial],
    n_passes: usize,
    weigh: Weigh<'_>,
) -> Result<Vec<Vec<ExprId>>, DeriveError> {
    let tree = &equations.tree;
    let depths = (0..tree.links.len()).map(|i| tree.path(Some(i)).len());
    let deepest = depths.max().unwrap_or(0);
    let styled = |change: fn(Style) -> Style| -> ColumnChange {
        Box::new(move |form| ColumnForm {
            style: change(form.style),
            ..form
        })
    };
    let in_fixed_axes: ColumnChange = Box::new(|form| ColumnForm {
        fixed_axes: true,
        style: Style {
            across_parallel_axes: false,
            ..form.style
        },
        ..form
    });
    let [across, axis_column, offset_after_turn] = styles().map(styled);
    let mut steps: Vec<Pass<ColumnForm>> = vec![
        vec![vec![across], vec![in_fixed_axes]],
        vec![vec![axis_column]],
        vec![vec![offset_after_turn]],
    ];
    steps.push(vec![vec![Box::new(|form| ColumnForm {
        axial: true,
        ..form
    })]]);
    let to = |moments, forces| -> ColumnChange {
        Box::new(move |form| ColumnForm {
            depths: Depths { moments, forces },
            ..form
        })
    };
    // Frames near the base are cheap to reach and save little.
    let both = (2.max(deepest / 2)..=deepest).map(|depth| to(depth, depth));
    let moments: ColumnChange = Box::new(|form| ColumnForm {
        depths: Depths {
            forces: 0,
            ..form.depths
        },
        ..form
    });
    steps.push(vec![both.collect(), vec![moments]]);
    if !has_parallel_axes(tree) {
        steps[0].clear();
    }
    steps.truncate(n_passes);
    let mut written = Written::default();
    let n_drives = mechanism.drives.len();
    let outputs = improve(graph, ColumnForm::PLAIN, &steps, weigh, |graph, form| {
        let key = (form.style, form.fixed_axes);
        let frames = written.of(graph, equations, &equations.gravity, key);
        let columns = equations.columns_of(graph, mechanism, frames, products, form)?;
        Ok(columns.into_iter().flatten().collect())
    })?;
    Ok(outputs.chunks(n_drives.max(1)).map(<[_]>::to_vec).collect())
}

/// The inverse dynamics in the form that costs least after the first `n_passes` passes.
pub(crate) fn total(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    value: &dyn Fn(&Monomial) -> ExprId,
    n_passes: usize,
    weigh: Weigh<'_>,
) -> Result<Vec<ExprId>, DeriveError> {
    let mut steps = total_steps(&equations.tree);
    steps.truncate(n_passes);
    let mut written = Written::default();
    improve(graph, TotalForm::PLAIN, &steps, weigh, |graph, form| {
        let key = (form.style, form.fixed_axes);
        let frames = written.of(graph, equations, &equations.gravity, key);
        equations.inverse_dynamics(graph, mechanism, frames, value, form)
    })
}

/// The generalised forces of all links under a gravity, finished by `finish`, in the form that costs least.
pub(crate) fn best_total(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    gravity: vector::Vector,
    value: &dyn Fn(&Monomial) -> ExprId,
    weigh: Weigh<'_>,
    mut finish: impl FnMut(&mut Graph, &[ExprId]) -> Vec<ExprId>,
) -> Result<Vec<ExprId>, DeriveError> {
    let n = mechanism.coordinates.len();
    let mut written = Written::default();
    improve(
        graph,
        TotalForm::PLAIN,
        &total_steps(&equations.tree),
        weigh,
        |graph, form| {
            let key = (form.style, form.fixed_axes);
            let frames = written.of(graph, equations, &gravity, key);
            let wrenches = form.wrenches(graph, equations, frames, value);
            let on_tree = newton_euler::backward(graph, &frames.tree, form.style, n, wrenches);
            Ok(finish(graph, &on_tree))
        },
    )
}

type ColumnChange = Change<ColumnForm>;
type TotalChange = Change<TotalForm>;

/// Whether there is a link whose joint is parallel to its parent's.
fn has_parallel_axes(tree: &Tree) -> bool {
    let mut links = tree.links.iter().enumerate();
    links.any(|(i, link)| link.first_parallel != i)
}

fn total_steps(tree: &Tree) -> Vec<Pass<TotalForm>> {
    let styled = |change: fn(Style) -> Style| -> TotalChange {
        Box::new(move |form| TotalForm {
            style: change(form.style),
            ..form
        })
    };
    let in_fixed_axes: TotalChange = Box::new(|form| TotalForm {
        fixed_axes: true,
        style: Style {
            across_parallel_axes: false,
            ..form.style
        },
        ..form
    });
    let [across, axis_column, offset_after_turn] = styles().map(styled);
    let mut steps: Vec<Pass<TotalForm>> = vec![
        vec![vec![across], vec![in_fixed_axes]],
        vec![vec![axis_column]],
        vec![vec![offset_after_turn]],
    ];
    if !has_parallel_axes(tree) {
        steps[0].clear();
    }
    steps.push(vec![vec![Box::new(|form| TotalForm {
        flat: true,
        ..form
    })]]);
    steps.push(vec![vec![Box::new(|form| TotalForm {
        turn_ends: true,
        ..form
    })]]);
    steps
}

/// The changes of style, in the order of [`PASSES`]; parallel axes are passed at once only where axes turn.
fn styles() -> [fn(Style) -> Style; 3] {
    [
        |style| Style {
            across_parallel_axes: true,
            ..style
        },
        |style| Style {
            axis_column: true,
            ..style
        },
        |style| Style {
            offset_after_turn: true,
            ..style
        },
    ]
}
