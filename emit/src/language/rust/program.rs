//! A program as a struct that stores precomputed values, and a method that computes the rest at a state.
//!
//! Decision: programs of more than 2000 statements are written as blocks of 250. Every `let` opens a scope inside
//! the one before, and rustc writes debug information scope by scope with recursion: a 6-UPS platform in one
//! function overflows its stack.

use std::collections::BTreeSet;

use modelmill_codegen::expr::Atom;
use modelmill_codegen::{Derivation, StraightLineProgram};

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

use super::statements::{RustSyntax, fill_lines, line_tokens, statements, verbatim_tokens};
use crate::identifier::field_identifier;
use crate::language::syntax::LanguageSyntax;
use crate::tree::{
    CodeStatement, NameScope, PrecomputedValues, SharedPose, StatementRoutine, inputs_of_state, reads_passive,
};

/// What a struct is prepared from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PreparationInputs {
    /// The geometry.
    Geometry,
    /// Geometry and base parameters.
    Base,
    /// Geometry and physical parameters.
    Parameters,
}

impl PreparationInputs {
    /// An expression of the first fault in these inputs, or `Ok`.
    fn check_tokens(self) -> TokenStream {
        match self {
            Self::Geometry => quote! { geometry.check() },
            Self::Base => quote! { geometry.check().and(check_base(base, &BASE_PARAMETERS)) },
            Self::Parameters => quote! { geometry.check().and(parameters.check()) },
        }
    }

    /// The parameters of `new`.
    fn parameter_tokens(self) -> TokenStream {
        match self {
            Self::Geometry => quote! { geometry: &Geometry<T> },
            Self::Base => quote! { geometry: &Geometry<T>, base: &[T; N_BASE] },
            Self::Parameters => {
                quote! { geometry: &Geometry<T>, parameters: &Parameters<T> }
            }
        }
    }
}

/// The inputs of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProgramStateInputs {
    /// Motion, and passive coordinates if Newton's method solves for them.
    Motion,
    /// Independent and passive coordinates.
    Pose,
}

/// A program with the method that runs it.
pub(super) struct ProgramMethod<'a> {
    /// The program.
    pub(super) program: &'a StraightLineProgram,
    /// Name of the method.
    pub(super) name: &'a str,
    /// Name of the struct that the runtime runs.
    pub(super) item: &'a str,
    /// Documentation of the method; empty without a method.
    pub(super) doc: String,
    /// Its inputs.
    pub(super) inputs: ProgramStateInputs,
    /// Names of the program's outputs, where they have one.
    pub(super) outputs: Vec<String>,
    /// Names of outputs that comments state and that values do not get, such as `H_2_4`.
    pub(super) entries: Vec<String>,
    /// Return type of the method; `None` if there is no method.
    pub(super) output: Option<TokenStream>,
    /// Conversion of the outputs, if the method returns another type.
    pub(super) results: Option<ResultConversion>,
}

/// A conversion of the outputs of a program to the result of a method.
pub(super) struct ResultConversion {
    /// Type of the outputs.
    pub(super) from_type: TokenStream,
    /// Expression of the result, with the outputs in `found`.
    pub(super) conversion: TokenStream,
}

/// A struct whose methods are programs.
pub(super) struct ProgramStruct<'a> {
    /// The model.
    pub(super) derivation: &'a Derivation,
    /// Names of all values.
    pub(super) scope: &'a NameScope,
    /// Name of the struct.
    pub(super) name: &'a str,
    /// Its documentation.
    pub(super) doc: TokenStream,
    /// Documentation of `new`.
    pub(super) prepares: &'a str,
    /// Whether struct and methods are public.
    pub(super) is_public: bool,
    /// Arguments of `new`.
    pub(super) preparation: PreparationInputs,
    /// Its programs.
    pub(super) functions: Vec<ProgramMethod<'a>>,
    /// Fields and methods in addition to the programs.
    pub(super) more: ExtraItems,
}

/// Items of a struct in addition to its programs.
/// Fields.
#[derive(Default)]
pub(super) struct ExtraItems {
    /// Initial values of these fields.
    pub(super) fields: TokenStream,
    /// Statements on the constructed `model`, at the end of `new`.
    pub(super) inits: TokenStream,
    /// Methods.
    pub(super) finish: TokenStream,
    pub(super) methods: TokenStream,
}

impl ProgramStruct<'_> {
    /// The struct, its programs as methods, and the items by which the runtime runs them.
    #[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
    pub(super) fn tokens(&self) -> TokenStream {
        // Statements of all programs; precomputed values are shared. Values of the common pose are taken out of each
        // program first.
        let mut once = PrecomputedValues::new(self.scope);
        let mut routines = Vec::new();
        for function in &self.functions {
            let pose = self.scope.pose.as_deref();
            // A program that does not begin with the common guards keeps its own pose.
            let rest = pose.and_then(|pose| pose.remaining_program(function.program));
            let program = rest.as_ref().unwrap_or(function.program);
            // The statements of the rest, without precomputed ones.
            let mut routine = StatementRoutine::new(program, self.scope, &function.outputs);
            if !function.entries.is_empty() {
                routine = routine.with_entry_names(&function.entries);
            }
            once.absorb(&mut routine);
            let pose = pose.filter(|_| rest.is_some());
            routine.read.extend(pose.iter().flat_map(|pose| &pose.inputs));
            routines.push((routine, pose));
        }
        let name = format_ident!("{}", self.name);
        // A field exists only if a program reads it.
        let reads = |wanted: fn(&Atom) -> bool| routines.iter().any(|(r, _)| r.read.iter().any(wanted));
        // Whether any program shares the pose.
        let has_pose = routines.iter().any(|(_, pose)| pose.is_some());
        let pose_field = has_pose.then(|| quote! { pose: Pose<T>, });
        let pose_init = has_pose.then(|| quote! { pose: Pose::new(geometry), });
        // Which inputs of the preparation are stored.
        let base = reads(|atom| matches!(atom, Atom::Base(_)));
        let physical = reads(|atom| matches!(atom, Atom::Parameter(_)));
        // Fields and initial values come in pairs.
        let base_field = base.then(|| quote! { base: [T; N_BASE], });
        let base_init = base.then(|| quote! { base: *base, });
        let physical_field = physical.then(|| quote! { parameters: Parameters<T>, });
        let physical_init = physical.then(|| quote! { parameters: *parameters, });
        // Other structs than `Model` contain one to solve for the passive coordinates.
        let newton = self.name != "Model" && self.functions.iter().any(|f| reads_passive(self.derivation, f.program));
        let model_field = newton.then(|| quote! { model: Model<T>, });
        let model_init = newton.then(|| quote! { model: Model::new(geometry), });
        // Precomputed values are an array, whose entries programs bind to their names.
        let kept: Vec<Ident> = once.kept.iter().map(|name| field_identifier(name)).collect();
        let n_kept = Literal::usize_unsuffixed(kept.len());
        let has_once = !kept.is_empty();
        let once_field = has_once.then(|| {
            quote! {
                /// Values that do not depend on the state.
                once: [T; #n_kept],
            }
        });
        let given = self.input_bindings(&once.read, false);
        // Statements of `new` before the struct is built.
        let begin = has_once.then(|| {
            let statements = statements(&once.statements());
            quote! { let n = &ScalarNumbers::<T>::new(); #given #statements }
        });
        let once_init = has_once.then(|| quote! { once: values![#(#kept),*], });
        let (parameters, prepares) = (self.preparation.parameter_tokens(), format!(" {}", self.prepares));
        // Invalid inputs are stored, and reported by every method.
        let check = self.preparation.check_tokens();
        let ExtraItems {
            fields,
            inits,
            finish,
            methods,
        } = &self.more;
        let prepared = quote! {
            Self {
                input, geometry: *geometry, #pose_init #base_init #physical_init #once_init #model_init #inits
            }
        };
        // Statements at the end of `new` need a name for the value.
        let new = if finish.is_empty() {
            prepared
        } else {
            quote! { let mut model = #prepared; #finish model }
        };
        let doc = &self.doc;
        let visible = self.is_public.then(|| quote! { pub });
        let functions: Vec<TokenStream> = (self.functions.iter().zip(&routines))
            .map(|(function, (routine, pose))| self.function(function, routine, *pose, &once))
            .collect();
        // One item per program: its struct for the runtime, names and number of inputs, number of outputs.
        let items = self.functions.iter().zip(&routines).map(|(function, (routine, _))| {
            let (item, program) = (
                format_ident!("{}", function.item),
                format_ident!("{}_program", function.name),
            );
            // Inputs of the program and the table of their names.
            let (inputs, names) = self.inputs(function, routine);
            let n_inputs = Literal::usize_unsuffixed(inputs.len());
            let n_outputs = Literal::usize_unsuffixed(routine.n_outputs);
            quote! { ::modelmill_runtime::program!(#item, #name, #program, #names, #n_inputs, #n_outputs); }
        });
        quote! {
            #doc
            #[derive(Clone, Copy, Debug, PartialEq)]
            #visible struct #name<T> {
                /// The fault of the geometry or the parameters, if they have one.
                input: Result<(), PoseError>,
                geometry: Geometry<T>,
                #pose_field
                #base_field
                #physical_field
                #once_field
                #model_field
                #fields
            }

            impl<T: Real> #name<T> {
                #[doc = #prepares]
                #visible fn new(#parameters) -> Self {
                    let input = #check;
                    #begin
                    #new
                }

                #(#functions)*
                #methods
            }

            #(#items)*
        }
    }

    /// The method of a program, and the program as a generic function over the numbers of the runtime.
    fn function(
        &self,
        function: &ProgramMethod<'_>,
        routine: &StatementRoutine,
        pose: Option<&SharedPose>,
        once: &PrecomputedValues,
    ) -> TokenStream {
        let program = format_ident!("{}_program", function.name);
        let (inputs, _) = self.inputs(function, routine);
        let n_inputs = Literal::usize_unsuffixed(inputs.len());
        // Bindings in front of the statements: constants and parameters, precomputed values, inputs, pose.
        let given = self.input_bindings(&routine.read, true);
        let once = precomputed_bindings(once, routine);
        let pose = pose.map(|pose| self.pose_bindings(pose, routine));
        let state = statements(&routine.state);
        let method = self.method(function);
        quote! {
            #method

            #[inline(always)]
            fn #program<N: Run<T, #n_inputs>>(&self, n: &mut N) -> Result<(), PoseError> {
                #given
                #once
                let [#(#inputs),*] = n.inputs();
                #pose
                #state
                Ok(())
            }
        }
    }

    /// The statement that binds the values of the common pose that a program reads.
    fn pose_bindings(&self, pose: &SharedPose, routine: &StatementRoutine) -> TokenStream {
        // Results that are not read are not bound.
        let called = (0..pose.routine.results.len()).map(|k| {
            let atom = Atom::Shared(k);
            if routine.read.contains(&atom) {
                RustSyntax.name(self.scope.input_name(atom))
            } else {
                "_".to_owned()
            }
        });
        // Coordinates are the arguments of the pose.
        let inputs = pose
            .inputs
            .iter()
            .map(|atom| RustSyntax.name(self.scope.input_name(*atom)));
        let inputs: Vec<String> = inputs.collect();
        let end = format!("] = self.pose.evaluate_at(&*n, [{}])?;", inputs.join(", "));
        line_tokens(&fill_lines("let [", called, &end))
    }

    /// The public method of a program. If it follows the loops, there is a second one that takes a guess.
    fn method(&self, function: &ProgramMethod<'_>) -> TokenStream {
        let Some(output) = &function.output else {
            return TokenStream::new();
        };
        let name = function.name;
        let (method, at_passive) = (format_ident!("{name}"), format_ident!("{name}_at"));
        let item = format_ident!("{}", function.item);
        let doc = format!(" {}", function.doc);
        // Every method of a state has these errors.
        let errors = quote! {
            ///
            /// # Errors
            /// A pose that is out of reach or singular, or an input that is NaN or too large.
        };
        // The call of the program, with the conversion of its outputs if there is one.
        let run = |inputs: TokenStream| match &function.results {
            None => quote! { run_checked(&#item(self), #inputs) },
            Some(ResultConversion {
                from_type: of,
                conversion: made,
            }) => quote! {
                let found: #of = run_checked(&#item(self), #inputs)?;
                Ok(#made)
            },
        };
        let visible = self.is_public.then(|| quote! { pub });
        // Without passive coordinates to solve for, the state is enough.
        if !reads_passive(self.derivation, function.program) {
            let run = run(quote! { inputs(state) });
            return quote! {
                #[doc = #doc]
                #errors
                #visible fn #method(&self, state: &State<T>) -> Result<#output, PoseError> {
                    self.input?;
                    #run
                }
            };
        }
        // The form with a guess.
        let near = format_ident!("{name}_near");
        let cost = " Cost: in addition, that of solving for the passive coordinates.";
        let same = format!(
            " The same as [`Self::{name}`], starting from the passive coordinates of a nearby pose, such as those of the \
             last cycle; they are replaced by those of this state."
        );
        let model = self.model();
        // Only users of the module have a nearby pose.
        let near = self.is_public.then(|| {
            quote! {
                #[doc = #same]
                #errors
                pub fn #near(&self, state: &State<T>, passive: &mut [T; N_PASSIVE]) -> Result<#output, PoseError> {
                    self.input?;
                    check_finite(&inputs(state), &INPUTS)?;
                    let found = #model.passive_position_near(&state.q, passive)?;
                    let result = self.#at_passive(state, &found)?;
                    *passive = found;
                    Ok(result)
                }
            }
        });
        // With passive coordinates: solve for them, then evaluate at them.
        let run = run(quote! { inputs_with_passive(state, passive) });
        quote! {
            #[doc = #doc]
            ///
            #[doc = #cost]
            #errors
            #visible fn #method(&self, state: &State<T>) -> Result<#output, PoseError> {
                self.input?;
                check_finite(&inputs(state), &INPUTS)?;
                self.#at_passive(state, &#model.passive_position(&state.q)?)
            }

            #near

            fn #at_passive(&self, state: &State<T>, passive: &[T; N_PASSIVE]) -> Result<#output, PoseError> {
                #run
            }
        }
    }

    /// The expression of the struct that solves for passive coordinates.
    fn model(&self) -> TokenStream {
        match self.preparation {
            PreparationInputs::Geometry if self.name == "Model" => quote! { self },
            _ => quote! { self.model },
        }
    }

    /// Patterns for the inputs, `_` for those that are not read, and the table with their names.
    fn inputs(&self, function: &ProgramMethod<'_>, routine: &StatementRoutine) -> (Vec<TokenStream>, TokenStream) {
        // Whether the inputs contain passive coordinates.
        let newton = function.inputs == ProgramStateInputs::Motion && reads_passive(self.derivation, function.program);
        let atoms = match function.inputs {
            ProgramStateInputs::Motion => inputs_of_state(self.derivation, newton),
            ProgramStateInputs::Pose => {
                let (active, passive) = self.derivation.coordinates();
                let all = active.into_iter().chain(passive);
                all.map(Atom::Coordinate).collect()
            }
        };
        // The table by which messages name an input.
        let names = match (function.inputs, newton) {
            (ProgramStateInputs::Motion, false) => quote! { INPUTS },
            (ProgramStateInputs::Motion, true) => quote! { INPUTS_WITH_PASSIVE },
            (ProgramStateInputs::Pose, _) => quote! { POSE },
        };
        let called = atoms.into_iter().map(|atom| {
            if routine.read.contains(&atom) {
                let name = field_identifier(self.scope.input_name(atom));
                quote! { #name }
            } else {
                quote! { _ }
            }
        });
        (called.collect(), names)
    }

    /// Bindings of the constants, parameters and base parameters that are read, from `self` or from the arguments of
    /// `new`.
    fn input_bindings(&self, read: &BTreeSet<Atom>, at_state: bool) -> TokenStream {
        let owner = at_state.then(|| quote! { self. });
        parameter_bindings(
            self.derivation,
            self.scope,
            read,
            &quote! { #owner geometry },
            &quote! { #owner parameters },
            if at_state { "self.base" } else { "base" },
        )
    }
}

/// Bindings of what is read of geometry, parameters and base parameters; `n` must be in scope.
pub(super) fn parameter_bindings(
    derivation: &Derivation,
    scope: &NameScope,
    read: &BTreeSet<Atom>,
    geometry: &TokenStream,
    parameters: &TokenStream,
    base: &str,
) -> TokenStream {
    let mechanism = &derivation.mechanism;
    let constants: Vec<&str> = mechanism.constants.iter().map(|c| c.name.as_str()).collect();
    let physical: Vec<&str> = mechanism.parameters.iter().map(|p| p.name.as_str()).collect();
    // One pattern per record, with the fields that are read.
    let record = |record: &str, names: &[&str], atom: fn(usize) -> Atom, from: &TokenStream| {
        let wanted: Vec<usize> = (0..names.len()).filter(|i| read.contains(&atom(*i))).collect();
        if wanted.is_empty() {
            return TokenStream::new();
        }
        // A field with another name in the scope is renamed in the pattern.
        let fields = wanted.iter().map(|i| {
            let (field, name) = (
                field_identifier(names[*i]),
                field_identifier(scope.input_name(atom(*i))),
            );
            if field == name {
                quote! { #field }
            } else {
                quote! { #field: #name }
            }
        });
        // Fields that are not read are skipped.
        let rest = (wanted.len() < names.len()).then(|| quote! { , .. });
        let record = format_ident!("{record}");
        quote! { let #record { #(#fields),* #rest } = #from.as_variables(n); }
    };
    let constants = record("Geometry", &constants, Atom::Constant, geometry);
    let physical = record("Parameters", &physical, Atom::Parameter, parameters);
    // Base parameters are entries of an array.
    let n_base = derivation.reduction.retained.len();
    let read_base = (0..n_base).filter(|k| read.contains(&Atom::Base(*k)));
    let base = array_bindings(
        read_base.map(|k| (field_identifier(scope.input_name(Atom::Base(k))), k)),
        base,
    );
    let pi = read
        .contains(&Atom::Pi)
        .then(|| quote! { let pi = n.number(::core::f64::consts::PI); });
    quote! { #constants #physical #base #pi }
}

/// Entries of an array, the same at every state, as variables.
fn array_bindings(entries: impl Iterator<Item = (Ident, usize)>, array: &str) -> TokenStream {
    let entries = entries.map(|(name, k)| format!("{name} = {k}"));
    let mut entries = entries.peekable();
    if entries.peek().is_none() {
        return TokenStream::new();
    }
    line_tokens(&fill_lines(&format!("read!(n, {array}; "), entries, ");"))
}

/// Bindings of the precomputed values that a program reads.
fn precomputed_bindings(once: &PrecomputedValues, routine: &StatementRoutine) -> TokenStream {
    let places = once.kept.iter().enumerate();
    // Positions in the array of precomputed values.
    let read = places.filter(|(_, name)| routine.kept.contains(name));
    array_bindings(read.map(|(k, name)| (field_identifier(name), k)), "self.once")
}

/// The struct `Pose` with the values that several programs share: loop closure and drive lengths. Nothing if they share
/// none.
pub(super) fn pose(derivation: &Derivation, scope: &NameScope) -> TokenStream {
    let Some(pose) = &scope.pose else {
        return TokenStream::new();
    };
    // Precomputed values of the pose, from the geometry.
    let given_once = parameter_bindings(
        derivation,
        scope,
        &pose.once.read,
        &quote! { geometry },
        &TokenStream::new(),
        "",
    );
    let written_once = statements(&pose.once.statements());
    let begin =
        (!pose.once.kept.is_empty()).then(|| quote! { let n = &ScalarNumbers::<T>::new(); #given_once #written_once });
    let names: Vec<Ident> = pose.once.kept.iter().map(|name| field_identifier(name)).collect();
    let n_kept = Literal::usize_unsuffixed(names.len());
    let read = parameter_bindings(
        derivation,
        scope,
        &pose.routine.read,
        &quote! { self.geometry },
        &TokenStream::new(),
        "",
    );
    // Bindings of the pose itself.
    let kept = precomputed_bindings(&pose.once, &pose.routine);
    let called = |atom: &Atom| field_identifier(scope.input_name(*atom));
    let n_inputs = Literal::usize_unsuffixed(pose.inputs.len());
    let inputs = pose.inputs.iter().map(|atom| called(atom).to_string());
    // Inputs arrive as one array.
    let inputs = line_tokens(&fill_lines("let [", inputs, "] = q;"));
    let n_results = Literal::usize_unsuffixed(pose.routine.results.len());
    // Results are returned as an array and not put into outputs.
    let state = pose.routine.state.iter();
    // The pose returns its results, so it stores no outputs.
    let state = state.filter(|statement| !matches!(statement, CodeStatement::Put { .. }));
    let state = statements(&state.cloned().collect::<Vec<CodeStatement>>());
    let results = (0..pose.routine.results.len()).map(|k| RustSyntax.name(scope.input_name(Atom::Shared(k))));
    let results = verbatim_tokens(&fill_lines("Ok(variables![", results, "])").join("\n"));
    quote! {
        /// Pose-dependent quantities (loop closure, drive lengths) shared by all functions.
        #[derive(Clone, Copy, Debug, PartialEq)]
        struct Pose<T> {
            geometry: Geometry<T>,
            once: [T; #n_kept],
        }

        impl<T: Real> Pose<T> {
            fn new(geometry: &Geometry<T>) -> Self {
                #begin
                Self { geometry: *geometry, once: values![#(#names),*] }
            }

            #[inline(always)]
            fn evaluate_at<N: Numbers<Scalar = T>>(
                &self,
                n: &N,
                q: [Var<N::Value>; #n_inputs],
            ) -> Result<[Var<N::Value>; #n_results], PoseError> {
                #inputs
                #read
                #kept
                #state
                #results
            }
        }
    }
}

/// The value of a program without inputs of a state, as an expression with `geometry` in scope.
pub(super) fn single_value(derivation: &Derivation, scope: &NameScope, program: &StraightLineProgram) -> TokenStream {
    let routine = StatementRoutine::new(program, scope, &[]);
    let (geometry, nothing) = (quote! { geometry }, TokenStream::new());
    let read: BTreeSet<Atom> = routine.read_once.union(&routine.read).copied().collect();
    let given = parameter_bindings(derivation, scope, &read, &geometry, &nothing, "");
    let once = statements(&routine.once);
    // The program has one output.
    let result = routine.results.first().map(|result| RustSyntax.operand_text(result));
    let result: TokenStream = result.unwrap_or_default().parse().unwrap_or_default();
    quote! { { let n = &ScalarNumbers::<T>::new(); #given #once (#result).get() } }
}
