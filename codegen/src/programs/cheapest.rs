//! The forms in which regressor and inverse dynamics can be written, and which of them costs least.
//!
//! All forms of a model have the same values. What they cost says who calls: for open chains the expressions as they
//! stand, since lowering finds little in them; for loops the finished programs.
//!
//! Decision: no form is cheapest for all mechanisms, so passes are tried in turn and one stays only where it lowers
//! the count. All forms agree to 1e-12 on every bundled model (a test), and none subtracts nearly equal numbers
//! beyond the scale of squared rates that the plain recursion has too.

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::vector;
use crate::expr::{ExprId, Graph};
use crate::newton_euler::{self, Depths, Style};
use crate::regressor::Equations;
use crate::regressor::form::{ColumnForm, Frames, TotalForm};
use crate::tree::Tree;
use crate::tree::expressions::Monomial;

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
    fn frames(
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
        let frames = written.frames(graph, equations, &equations.gravity, key);
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
        let frames = written.frames(graph, equations, &equations.gravity, key);
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
            let frames = written.frames(graph, equations, &gravity, key);
            let wrenches = form.wrenches(graph, &equations.inertia, &equations.tree, frames, value);
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
