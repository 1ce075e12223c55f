//! The forms in which regressor and inverse dynamics can be written, and the search for the cheapest one.
//!
//! All forms of a model have the same values. The caller states the cost: for open chains that of the expressions,
//! since lowering saves little there; for loops that of the finished programs.
//!
//! Decision: no form is cheapest for all mechanisms, so passes are tried in turn and one stays only where it lowers
//! the count. All forms agree to 1e-12 on every bundled model (a test), and none subtracts nearly equal numbers
//! beyond the scale of squared rates that the plain recursion has too.

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::vector;
use crate::expr::{ExprId, Graph};
use crate::newton_euler::{self, CarryDepths, RecursionStyle};
use crate::regressor::UnreducedEquations;
use crate::regressor::form::{ColumnForm, RecursionFrames, TotalForm};
use crate::stop::StopRequest;
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// A change from one form to another.
type FormChange<F> = Box<dyn Fn(F) -> F>;
/// Families of changes that a pass tries.
type ChangeFamilies<F> = Vec<Vec<FormChange<F>>>;

/// Most entries of columns, as columns times the depth of the tree, whose form is searched with all columns (1). A search
/// writes them some twenty times; that of a humanoid with 40 coordinates takes about a second.
const MOST_SEARCHED_ENTRIES: usize = 5000;

/// Cost of outputs, in additions.
pub(crate) type CostFunction<'a> = &'a dyn Fn(&mut Graph, &[ExprId]) -> usize;

/// How cheaper forms are searched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FormSearch<'a> {
    /// How many of [`PASSES`] are tried.
    pub(crate) n_passes: usize,
    /// When the search stops.
    pub(crate) stop: StopRequest<'a>,
}

impl FormSearch<'_> {
    /// The plain form.
    pub(crate) const NONE: Self = Self {
        n_passes: 0,
        stop: StopRequest::NEVER,
    };
}

/// Searches for the cheapest form, pass by pass; a change that does not lower the cost is discarded. Returns the form
/// and its outputs.
///
/// `write` returns the outputs of a form. `steps` has for every pass the families of changes that it applies to the
/// best form before it. The changes of a family go in one direction, and the rest is skipped once the cost rises.
fn search_cheapest_form<F: Copy>(
    graph: &mut Graph,
    plain: F,
    steps: &[ChangeFamilies<F>],
    weigh: CostFunction<'_>,
    stop: StopRequest<'_>,
    mut write: impl FnMut(&mut Graph, F) -> Result<Vec<ExprId>, DeriveError>,
) -> Result<(F, Vec<ExprId>), DeriveError> {
    // The best form so far with its outputs and cost.
    let (mut form, mut best) = (plain, write(graph, plain)?);
    let mut least = weigh(graph, &best);
    for pass in steps {
        for family in pass {
            // All changes of a family apply to the same form.
            let before = form;
            let mut last = usize::MAX;
            for change in family {
                stop.check()?;
                let changed = change(before);
                let outputs = write(graph, changed)?;
                // Many changes have no effect on planar mechanisms, and computing the cost takes longest.
                if outputs == best {
                    continue;
                }
                let cost = weigh(graph, &outputs);
                if cost < least {
                    (form, best, least) = (changed, outputs, cost);
                }
                // The family has passed its minimum.
                if cost > last {
                    break;
                }
                last = cost;
            }
        }
    }
    Ok((form, best))
}

/// Frames of the recursion by style and axes, so that each is written once.
#[derive(Default)]
struct FrameCache(Vec<((RecursionStyle, bool), RecursionFrames)>);

impl FrameCache {
    /// The frames for a style and axes; they are written at the first call.
    fn frames_for(
        &mut self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        gravity: &vector::SymbolicVector,
        key: (RecursionStyle, bool),
    ) -> &mut RecursionFrames {
        // Few frames are written, so a list is searched.
        let at = self.0.iter().position(|(k, _)| *k == key);
        let at = at.unwrap_or_else(|| {
            let frames = RecursionFrames::new(graph, &equations.tree, gravity, key.0, key.1);
            self.0.push((key, frames));
            self.0.len() - 1
        });
        &mut self.0[at].1
    }
}

/// The passes of the recursions, by name, in the order in which they are tried.
pub(crate) const PASSES: [&str; 5] = [
    "parallel axes combined, or in fixed axes",
    "acceleration of a joint's axis from its parent",
    "offsets along an axis after its joint",
    "moments about a joint's axis on its fixed side",
    "inertia rotated instead of motion, forces computed in one frame",
];

/// The columns of some products, one entry per drive, in the cheapest form that `search` finds.
pub(crate) fn cheapest_columns(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    products: &[ParameterMonomial],
    search: FormSearch<'_>,
    weigh: CostFunction<'_>,
) -> Result<Vec<Vec<ExprId>>, DeriveError> {
    let every = choose_column_interval(products.len() * depth_of_tree(&equations.tree));
    cheapest_columns_by_sample(graph, mechanism, equations, products, search, every, weigh)
}

/// Depth of the tree, in links.
fn depth_of_tree(tree: &KinematicTree) -> usize {
    let depths = (0..tree.links.len()).map(|i| tree.path_to(Some(i)).len());
    depths.max().unwrap_or(0)
}

/// Interval of the columns with which the form is searched: 1 for all of them, more for trees with more entries than
/// [`MOST_SEARCHED_ENTRIES`].
fn choose_column_interval(n_entries: usize) -> usize {
    let mut every = n_entries.div_ceil(MOST_SEARCHED_ENTRIES).max(1);
    // Each body has ten parameters in one order: other strides miss some kinds of columns.
    while every.is_multiple_of(2) || every.is_multiple_of(5) {
        every += 1;
    }
    every
}

/// The same; the form is searched with one of `every` columns.
fn cheapest_columns_by_sample(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    products: &[ParameterMonomial],
    search: FormSearch<'_>,
    every: usize,
    weigh: CostFunction<'_>,
) -> Result<Vec<Vec<ExprId>>, DeriveError> {
    let tree = &equations.tree;
    let deepest = depth_of_tree(tree);
    // A change of style only.
    let styled = |change: fn(RecursionStyle) -> RecursionStyle| -> ColumnChange {
        Box::new(move |form| ColumnForm {
            style: change(form.style),
            ..form
        })
    };
    // Fixed axes exclude the combination of parallel axes.
    let in_fixed_axes: ColumnChange = Box::new(|form| ColumnForm {
        fixed_axes: true,
        style: RecursionStyle {
            across_parallel_axes: false,
            ..form.style
        },
        ..form
    });
    let [across, axis_column, offset_after_turn] = style_changes().map(styled);
    // One entry per pass, in the order of [`PASSES`].
    let mut steps: Vec<ChangeFamilies<ColumnForm>> = vec![
        vec![vec![across], vec![in_fixed_axes]],
        vec![vec![axis_column]],
        vec![vec![offset_after_turn]],
    ];
    steps.push(vec![vec![Box::new(|form| ColumnForm { axial: true, ..form })]]);
    // Depths to which moments and forces are carried.
    let to = |moments, forces| -> ColumnChange {
        Box::new(move |form| ColumnForm {
            depths: CarryDepths { moments, forces },
            ..form
        })
    };
    // Frames near the base are cheap to reach and save little, so the search begins halfway.
    let both = (2.max(deepest / 2)..=deepest).map(|depth| to(depth, depth));
    let moments: ColumnChange = Box::new(|form| ColumnForm {
        depths: CarryDepths {
            forces: 0,
            ..form.depths
        },
        ..form
    });
    steps.push(vec![both.collect(), vec![moments]]);
    // Without parallel axes the first pass changes nothing.
    if !has_parallel_axes(tree) {
        steps[0].clear();
    }
    steps.truncate(search.n_passes);
    let mut written = FrameCache::default();
    let mut write = |graph: &mut Graph, form: ColumnForm, products: &[ParameterMonomial]| {
        let key = (form.style, form.fixed_axes);
        let frames = written.frames_for(graph, equations, &equations.gravity, key);
        equations.columns_of(graph, mechanism, frames, products, form)
    };
    // Outputs are searched as one list, and then cut into columns. Of a large tree some columns decide for all.
    let searched: Vec<ParameterMonomial> = products.iter().step_by(every).cloned().collect();
    let n_drives = mechanism.drives.len();
    let found = search_cheapest_form(graph, ColumnForm::PLAIN, &steps, weigh, search.stop, |graph, form| {
        Ok(write(graph, form, &searched)?.into_iter().flatten().collect())
    });
    let (form, outputs) = found?;
    if every > 1 {
        return write(graph, form, products);
    }
    Ok(outputs.chunks(n_drives.max(1)).map(<[_]>::to_vec).collect())
}

/// The inverse dynamics in the cheapest form that `search` finds.
pub(crate) fn cheapest_total(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
    search: FormSearch<'_>,
    weigh: CostFunction<'_>,
) -> Result<Vec<ExprId>, DeriveError> {
    let mut steps = total_form_steps(&equations.tree);
    steps.truncate(search.n_passes);
    let mut written = FrameCache::default();
    let found = search_cheapest_form(graph, TotalForm::PLAIN, &steps, weigh, search.stop, |graph, form| {
        let key = (form.style, form.fixed_axes);
        let frames = written.frames_for(graph, equations, &equations.gravity, key);
        equations.inverse_dynamics(graph, mechanism, frames, value, form)
    });
    found.map(|(_, outputs)| outputs)
}

/// The generalised forces of all links under a gravity, in the cheapest form. `finish` turns them into the outputs
/// whose cost counts.
pub(crate) fn best_total(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    gravity: vector::SymbolicVector,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
    weigh: CostFunction<'_>,
    mut finish: impl FnMut(&mut Graph, &[ExprId]) -> Vec<ExprId>,
) -> Result<Vec<ExprId>, DeriveError> {
    let n = mechanism.coordinates.len();
    let mut written = FrameCache::default();
    let found = search_cheapest_form(
        graph,
        TotalForm::PLAIN,
        &total_form_steps(&equations.tree),
        weigh,
        StopRequest::NEVER,
        |graph, form| {
            let key = (form.style, form.fixed_axes);
            let frames = written.frames_for(graph, equations, &gravity, key);
            let wrenches = form.wrenches(graph, &equations.inertia, &equations.tree, frames, value);
            let on_tree = newton_euler::backward_recursion(graph, &frames.tree, form.style, n, wrenches);
            Ok(finish(graph, &on_tree))
        },
    );
    found.map(|(_, outputs)| outputs)
}

/// A change of a regressor column's form.
type ColumnChange = FormChange<ColumnForm>;
/// A change of the inverse dynamics' form.
type TotalChange = FormChange<TotalForm>;

/// Whether a joint is parallel to that of its parent.
fn has_parallel_axes(tree: &KinematicTree) -> bool {
    let mut links = tree.links.iter().enumerate();
    links.any(|(i, link)| link.first_parallel != i)
}

/// The passes for inverse dynamics, in the order of [`PASSES`].
fn total_form_steps(tree: &KinematicTree) -> Vec<ChangeFamilies<TotalForm>> {
    // A change of style only.
    let styled = |change: fn(RecursionStyle) -> RecursionStyle| -> TotalChange {
        Box::new(move |form| TotalForm {
            style: change(form.style),
            ..form
        })
    };
    let in_fixed_axes: TotalChange = Box::new(|form| TotalForm {
        fixed_axes: true,
        style: RecursionStyle {
            across_parallel_axes: false,
            ..form.style
        },
        ..form
    });
    let [across, axis_column, offset_after_turn] = style_changes().map(styled);
    let mut steps: Vec<ChangeFamilies<TotalForm>> = vec![
        vec![vec![across], vec![in_fixed_axes]],
        vec![vec![axis_column]],
        vec![vec![offset_after_turn]],
    ];
    if !has_parallel_axes(tree) {
        steps[0].clear();
    }
    steps.push(vec![vec![Box::new(|form| TotalForm { flat: true, ..form })]]);
    steps.push(vec![vec![Box::new(|form| TotalForm {
        turn_ends: true,
        ..form
    })]]);
    steps
}

/// The changes of style, in the order of [`PASSES`].
fn style_changes() -> [fn(RecursionStyle) -> RecursionStyle; 3] {
    [
        |style| RecursionStyle {
            across_parallel_axes: true,
            ..style
        },
        |style| RecursionStyle {
            axis_column: true,
            ..style
        },
        |style| RecursionStyle {
            offset_after_turn: true,
            ..style
        },
    ]
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::lower::cost::cost;
    use crate::regressor::unreduced_equations;

    /// Cost of all columns in the form that is found with one of `every` columns.
    fn cost_by_sample(mechanism: &Mechanism, every: usize) -> usize {
        let mut graph = Graph::new();
        let equations = unreduced_equations(&mut graph, mechanism).unwrap();
        let weigh = |graph: &mut Graph, outputs: &[ExprId]| cost(graph, outputs);
        let products = equations.products.clone();
        let search = FormSearch {
            n_passes: PASSES.len(),
            ..FormSearch::NONE
        };
        let columns =
            cheapest_columns_by_sample(&mut graph, mechanism, &equations, &products, search, every, &weigh).unwrap();
        let outputs: Vec<ExprId> = columns.into_iter().flatten().collect();
        cost(&graph, &outputs)
    }

    /// A form that some columns decide costs little more than the form that all columns decide, with at least
    /// eighteen of them. Nine of the 60 columns of an arm cost up to a fifth more, and large trees never have so few.
    #[test]
    fn some_columns_find_the_form_of_all() {
        for name in ["puma560", "rx90", "stanford", "tx40", "panda", "quadruped", "humanoid"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../model-spec/models/{name}.toml"));
            let mechanism = modelmill_spec::load_file(&path).unwrap().mechanism;
            let n_products = unreduced_equations(&mut Graph::new(), &mechanism)
                .unwrap()
                .products
                .len();
            let complete = cost_by_sample(&mechanism, 1);
            for every in [3, 7, 11].into_iter().filter(|every| n_products / every >= 18) {
                let sampled = cost_by_sample(&mechanism, every);
                assert!(
                    100 * sampled <= 102 * complete,
                    "{name}, one of {every}: {sampled} instead of {complete}"
                );
            }
        }
    }

    #[test]
    fn the_interval_reaches_every_kind_of_parameter() {
        assert_eq!(choose_column_interval(0), 1);
        assert_eq!(choose_column_interval(MOST_SEARCHED_ENTRIES), 1);
        for n_entries in (MOST_SEARCHED_ENTRIES + 1..100 * MOST_SEARCHED_ENTRIES).step_by(777) {
            let every = choose_column_interval(n_entries);
            // With ten parameters for each body, ten steps meet each of them once.
            let kinds: std::collections::BTreeSet<usize> = (0..10).map(|k| k * every % 10).collect();
            assert_eq!(kinds.len(), 10);
            assert!(n_entries <= every * MOST_SEARCHED_ENTRIES);
        }
    }
}
