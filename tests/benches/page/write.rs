//! The page itself, in Markdown: every number in it comes from the run.

use std::fmt::Write as _;

use modelmill_codegen::{OperationCount, PassCount, ProgramStage, ReductionMethod, StraightLineProgram};
use modelmill_tests::counts::{HEADINGS, best_known, row, text};
use modelmill_tests::fixtures::derived;

use crate::c99::C99;
use crate::peers::{GENERATORS, Peers};
use crate::{Figures, GENERATIONS, TURNS, run};

/// Models whose operations are shown pass by pass.
const BY_PASS: [&str; 6] = [
    "two_link",
    "puma560",
    "rx90",
    "panda",
    "five_bar-tied-tool",
    "spidermill",
];

/// What each pass saves of a model, and what the mass matrix takes.
pub(crate) struct Passes {
    name: &'static str,
    counts: Vec<PassCount>,
    mass_matrix: OperationCount,
}

/// Counts pass by pass, of all models or of those that are named.
pub(crate) fn passes(names: &[&str]) -> Result<Vec<Passes>, String> {
    let chosen = BY_PASS.into_iter().filter(|m| names.is_empty() || names.contains(m));
    chosen
        .map(|name| {
            let derivation = derived(name);
            let fault = |error: modelmill_codegen::DeriveError| format!("{name}: {error}");
            let count = |program: &StraightLineProgram| program.count_operations(ProgramStage::State);
            Ok(Passes {
                name,
                counts: derivation.operations_by_pass().map_err(fault)?,
                mass_matrix: count(&derivation.dynamics().map_err(fault)?.mass_matrix),
            })
        })
        .collect()
}

/// The whole page.
pub(crate) fn page(all: &[Figures], passes: &[Passes], peers: &Peers, machine: &[(&str, String)]) -> String {
    let mut page = "# Benchmarks\n\n\
        Written by `cargo bench -p modelmill-tests --bench page`; not edited by hand.\n\
        Every number comes from one run on one machine, but the best known counts of others, which are from the literature.\n\n"
        .to_owned();
    headline(&mut page, all);
    method(&mut page, peers, machine);
    operations(&mut page, all);
    by_pass(&mut page, passes);
    generation(&mut page, all, peers);
    run_time(&mut page, all, peers);
    page
}

fn table(page: &mut String, headings: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    _ = writeln!(page, "| {} |", headings.join(" | "));
    let numbers = vec!["---:"; headings.len().saturating_sub(1)];
    _ = writeln!(page, "|---|{}|", numbers.join("|"));
    for cells in rows {
        _ = writeln!(page, "| {} |", cells.join(" | "));
    }
    page.push('\n');
}

/// How many times longer `a` is than `b`.
fn ratio(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    Some(a? / b?)
}

fn times(ratio: Option<f64>) -> String {
    ratio.map_or_else(
        || "-".to_owned(),
        |r| {
            if r < 10.0 { format!("{r:.2}") } else { format!("{r:.1}") }
        },
    )
}

impl Figures {
    pub(crate) fn time(&self, who: &str, function: &str) -> Option<f64> {
        self.times.get(&format!("{who}: {function}")).copied()
    }

    /// How many times longer a contestant takes than emitted code for one state.
    fn longer(&self, who: &str, function: &str) -> Option<f64> {
        ratio(self.time(who, function), self.time("one state", function))
    }

    /// How many times faster blocks are than another way of our own.
    fn faster(&self, who: &str, than: &str, function: &str) -> Option<f64> {
        ratio(self.time(than, function), self.time(who, function))
    }

    /// A peer's cell: a ratio, or why there is none.
    fn peer(&self, value: Option<f64>, who: &str, peers: &Peers) -> String {
        if value.is_some() || self.no_chain.is_some() {
            return times(value);
        }
        let word = if peers.installed(who) { "none" } else { "not installed" };
        word.to_owned()
    }
}

/// The Panda, in a few lines.
fn headline(page: &mut String, all: &[Figures]) {
    let Some(panda) = all.iter().find(|f| f.name == "panda") else {
        return;
    };
    let f = "inverse dynamics";
    let mut lines = Vec::new();
    if let (Some(forces), Some(columns)) = (panda.time("one state", f), panda.time("one state", "regressor")) {
        lines.push(format!(
            "inverse dynamics in {forces:.0} ns per state, base regressor in {columns:.0} ns"
        ));
    }
    if let (Some(a), Some(b)) = (panda.longer("Pinocchio", f), panda.longer("Pinocchio", "regressor")) {
        lines.push(format!(
            "{a:.1} times faster than Pinocchio's RNEA, {b:.1} times faster than its joint torque regressor"
        ));
    }
    let generated = GENERATORS.iter().filter_map(|g| Some((*g, panda.longer(g, f)?)));
    if let Some((name, r)) = generated.min_by(|a, b| a.1.total_cmp(&b.1)) {
        lines.push(format!(
            "the fastest generated peer ({name}) takes {r:.2} times as long"
        ));
    }
    for (function, what) in [(f, "inverse dynamics"), ("regressor", "the regressor")] {
        if let (Some(a), Some(b), Some(one)) = (
            panda.faster("blocks", "scalar", function),
            panda.faster("blocks, 256 bits", "scalar", function),
            panda.faster("blocks", "one state", function),
        ) {
            lines.push(format!(
                "{what} of many states in blocks is {a:.1} times faster per state than in scalar instructions, and \
                 {b:.1} times with vectors of 256 bits. It is {one:.1} times faster than the function for one state, which \
                 computes sine and cosine of an angle together"
            ));
        }
    }
    if let Some(ms) = panda.generation.get("all") {
        lines.push(format!(
            "from the model file to the source of its code in {ms:.0} ms of one core"
        ));
    }
    if !lines.is_empty() {
        page.push_str("Franka Panda, seven joints:\n\n");
        for line in lines {
            _ = writeln!(page, "- {line}");
        }
        page.push_str("\n![Nanoseconds per state of the Panda: modelmill and its peers](pictures/benchmarks.svg)\n\n");
    }
}

fn method(page: &mut String, peers: &Peers, machine: &[(&str, String)]) {
    page.push_str("## Method\n\n");
    let core = match run::core() {
        Some(_) => "Every program is held on the same core.",
        None => "Programs could not be held on one core (`taskset` is missing).",
    };
    _ = writeln!(
        page,
        "{core}\n\
         Contestants have {TURNS} turns each, one after the other; in a turn a function goes through {} states again and again, and the best round of all turns counts: other load on the machine only ever makes a round longer.\n\
         The states are of a smooth motion around the nominal pose; inputs and results are hidden from the optimiser (`black_box`; a barrier in C++).\n\
         Ratios are of best rounds of the same run.\n\n\
         Our code is the emitted Rust, compiled for any processor of its kind (no `target-cpu`), with geometry and base parameters as run-time values; blocks choose their vectors at run time.\n\
         Peers are compiled by `g++ -O3 -march=native`, generated code with all numbers of the model in place. Pinocchio's CasADi is its own algorithm through `pinocchio/autodiff/casadi.hpp`; CasADi, wrenfold and sympy unroll one plain recursion. They know bodies alone: where a model has friction or drive inertias, our code computes these besides.\n\
         All peers' torques agree with ours to 1e-10 of the largest before they are timed. They take open chains; `-` is where a model is none.\n\n\
         Operations are additions with subtractions and multiplications of what is computed at every state, then in brackets divisions with roots, and pairs of sine and cosine; negations, and what depends on geometry and parameters alone, are not counted.\n\
         Generation is processor time of one core in a fresh process, the best of {GENERATIONS}, and of peers the one time that it was needed.\n",
        crate::models::STATES
    );
    page.push_str("|  |  |\n|---|---|\n");
    let versions = peers.versions.iter().map(|(n, v)| (n.as_str(), v));
    for (name, value) in machine.iter().map(|(n, v)| (*n, v)).chain(versions) {
        _ = writeln!(page, "| {name} | {value} |");
    }
    page.push('\n');
    if !peers.missing.is_empty() {
        page.push_str("Left out:\n\n");
        for line in &peers.missing {
            _ = writeln!(page, "- {line}");
        }
        page.push('\n');
    }
}

fn operations(page: &mut String, all: &[Figures]) {
    page.push_str("## Operations\n\n");
    table(page, &HEADINGS, all.iter().map(|f| row(&f.name, &f.derivation)));
}

fn by_pass(page: &mut String, passes: &[Passes]) {
    if passes.is_empty() {
        return;
    }
    page.push_str(
        "### Pass by pass\n\n\
         After each pass and all before it; a pass of the recursions is used only where it pays.\n\n",
    );
    for model in passes {
        _ = writeln!(page, "`{}`:\n", model.name);
        let mut rows: Vec<Vec<String>> = model
            .counts
            .iter()
            .map(|c| vec![c.pass.to_owned(), text(&c.inverse_dynamics), text(&c.regressor)])
            .collect();
        let [a, b] = best_known(model.name);
        if a.or(b).is_some() {
            let of = |n: Option<usize>| n.map_or_else(|| "-".to_owned(), |n| n.to_string());
            rows.push(vec!["best known of others".to_owned(), of(a), of(b)]);
        }
        rows.push(vec![
            "mass matrix, by itself".to_owned(),
            text(&model.mass_matrix),
            "-".to_owned(),
        ]);
        table(page, &["after", "inverse dynamics", "base regressor"], rows);
    }
}

fn generation(page: &mut String, all: &[Figures], peers: &Peers) {
    page.push_str(
        "## Generation\n\n\
         Milliseconds from the model file to the source of inverse dynamics, regressor and base parameters, and how many times longer peers take for inverse dynamics alone, without compiling.\n\n",
    );
    let mut headings = vec!["model", "read", "derive and reduce", "emit", "all", "reduction"];
    headings.extend(GENERATORS);
    let rows = all.iter().map(|f| {
        let of = |stage: &str| {
            let ms = f.generation.get(stage);
            ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.1}"))
        };
        let reduction = match f.derivation.reduction.method {
            ReductionMethod::Exact { .. } => "exact",
            _ => "numeric",
        };
        let mut cells = vec![f.name.clone(), of("load"), of("derive"), of("emit"), of("all")];
        cells.push(reduction.to_owned());
        cells.extend(GENERATORS.iter().map(|g| {
            let took = f.peers_generation.get(g).copied();
            f.peer(ratio(took, f.generation.get("all").copied()), g, peers)
        }));
        cells
    });
    table(page, &headings, rows);
}

fn run_time(page: &mut String, all: &[Figures], peers: &Peers) {
    page.push_str(
        "## Run time\n\n\
         Nanoseconds per state: one state at a time, with sine and cosine of an angle computed together; many states in scalar instructions, one number at a time; in blocks of the widest vectors of this machine and of 256 bits. How many times faster than in scalar instructions blocks are; and how many times longer than one state in Rust our C99 (`cc -O3`) and peers take.\n\n\
         Inverse dynamics:\n\n",
    );
    let rows = |function: &'static str, who: Vec<&'static str>| {
        all.iter().map(move |f| {
            let mut cells = vec![f.name.clone()];
            cells.extend(["one state", "scalar", "blocks", "blocks, 256 bits"].map(|who| {
                let ns = f.time(who, function);
                ns.map_or_else(|| "-".to_owned(), |ns| format!("{ns:.1}"))
            }));
            cells.push(times(f.faster("blocks", "scalar", function)));
            cells.push(times(f.faster("blocks, 256 bits", "scalar", function)));
            cells.push(times(f.longer(C99, function)));
            cells.extend(who.iter().map(|w| f.peer(f.longer(w, function), w, peers)));
            cells
        })
    };
    let ours = [
        "model",
        "one state",
        "scalar",
        "blocks",
        "256 bits",
        "scalar / blocks",
        "scalar / 256 bits",
        C99,
    ];
    let who: Vec<&str> = std::iter::once("Pinocchio").chain(GENERATORS).collect();
    let headings: Vec<&str> = ours.into_iter().chain(who.iter().copied()).collect();
    table(page, &headings, rows("inverse dynamics", who));
    page.push_str(
        "Regressor: ours of the base parameters; Pinocchio's (`computeJointTorqueRegressor`) of all ten parameters of each body, since it has no reduced one.\n\n",
    );
    let headings: Vec<&str> = ours.into_iter().chain(["Pinocchio"]).collect();
    table(page, &headings, rows("regressor", vec!["Pinocchio"]));
    let reasons: Vec<String> = all
        .iter()
        .filter_map(|f| Some(format!("`{}` ({})", f.name, f.no_chain.as_ref()?)))
        .collect();
    if !reasons.is_empty() {
        _ = writeln!(page, "No chain of bodies for the peers: {}.", reasons.join(", "));
    }
}
