//! A model file that was read, with the equations derived from it and the names and units that users see.

mod changes;
mod entries;
mod equation_sample;
mod equations;
mod gravity_variants;
mod magnitudes;
mod sampled_rank;
mod summary;
mod thresholds;
mod values;

use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Remedy};
use modelmill_codegen::review::base_expression;
use modelmill_codegen::{BaseParameterEntry, ColumnDependency, Derivation, ParameterMonomial, StopRequest};
use modelmill_identify::estimate::ParameterPrior;
use modelmill_identify::{ParameterInfo, RecordingNote};
use modelmill_spec::{
    EffectKind, ExactExpression, FrameStep, Mechanism, ModelSymbol, ParameterIdx, PartInertia, PlaceQuantity, Sign,
};
use nalgebra::DMatrix;

use crate::error::{Error, Outcome};
use crate::host::Host;
use gravity_variants::GravityVariants;

pub use changes::{BaseValueChange, EntryChange, ModelChanges};
pub use equations::EquationsText;
pub use magnitudes::ModelMagnitudes;
pub(crate) use magnitudes::state_at_standstill;
pub use modelmill_codegen::review::PageFormat;
pub use modelmill_spec::LoadedModel;
pub use sampled_rank::SampledRank;
pub(crate) use sampled_rank::reachable_states;
pub use summary::{ModelCheck, ModelSummary};
pub use values::BaseParameterValues;

/// A model file that was read, with the equations derived from it. A clone shares the derivation.
#[derive(Clone)]
pub struct Model {
    /// The file's name without folder and extension; also the name of the model in the JSON.
    pub name: String,
    /// Path of the file as it was given, for messages; the given name for a model that was read from text.
    pub path: String,
    /// The contents of the file.
    pub loaded: Arc<LoadedModel>,
    /// The derivation: parameter products p_g, linear dependencies of the regressor columns, base parameters p_min, and
    /// straight-line programs. A straight-line program is a list of assignments without branches.
    pub derivation: Arc<Derivation>,
    /// The base parameters, eq. (16), with names, expressions and units.
    pub base: Vec<BaseParameterEntry>,
    /// The values of the base parameters that the model uses, in their units and in the order of `base`. Each is the
    /// identified value if the file or a fit has one ([`Model::with_fit`], [`Model::is_identified`]); otherwise it is
    /// computed from the nominal values of the file.
    pub values: Vec<f64>,
    /// Notes on the file in addition to the warnings of `loaded`, such as entries that are ignored.
    pub notes: Vec<RecordingNote>,
    /// Covariance of the values in `values`, if they come from a fit that has one.
    covariance: Option<Arc<DMatrix<f64>>>,
    /// Whether each of `values` was identified, in the file or in a fit.
    identified: Vec<bool>,
    /// The sign that each dynamic parameter must have, in the order of the mechanism.
    signs: Vec<Sign>,
    /// Provides the file, and all files that are read later.
    host: Host,
    /// The same model with other directions of gravity, as far as they were derived.
    gravity_variants: GravityVariants,
}

impl Model {
    /// Reads a model file from disk and derives its equations.
    ///
    /// Fails with all errors and warnings of the file, each with its line and column, or with the reason why the
    /// equations cannot be derived.
    ///
    /// ```
    /// use modelmill::Model;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// assert_eq!(arm.row_names(), ["joint1", "joint2"]);
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Outcome<Self> {
        Host::new().model(path)
    }

    /// Reads a model from the text of its file and derives its equations. The text must not extend another file. `name`
    /// is only used as the name of the model and of its file in messages.
    ///
    /// Fails as [`Model::open`] does.
    ///
    /// ```
    /// let text = std::fs::read_to_string("../model-spec/models/two_link.toml").unwrap();
    /// let arm = modelmill::Model::from_text("arm.toml", &text)?;
    /// assert_eq!(arm.name, "arm");
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn from_text(name: &str, text: &str) -> Outcome<Self> {
        let host = Host::new();
        let loaded = host.load_text(Path::new(name), text)?;
        host.derive(name, loaded)
    }
}

impl Host {
    /// Reads a model file and derives its equations.
    ///
    /// Fails with all errors and warnings of the file, each with its line and column, or with the reason why the
    /// equations cannot be derived.
    pub fn model(&self, path: impl AsRef<Path>) -> Outcome<Model> {
        let path = path.as_ref();
        let loaded = self.load(path)?;
        self.derive(&path.display().to_string(), loaded)
    }

    /// Derives the equations of a model file that was read from `path`.
    ///
    /// Fails with the reason why the equations cannot be derived.
    pub fn derive(&self, path: &str, mut loaded: LoadedModel) -> Outcome<Model> {
        if self.has_numeric_constants() {
            loaded.mechanism = loaded.mechanism.with_numeric_constants();
        }
        let mechanism = &loaded.mechanism;
        let derivation = self
            .run_job(&format!("deriving {}", mechanism.name), 0, |job| {
                let is_cancelled = || job.is_cancelled();
                modelmill_codegen::derive_until(mechanism, StopRequest::new(&is_cancelled))
            })?
            .map_err(|error| Error::derivation(path, error))?;
        // Warnings about the derived model become notes with their line and column in the file.
        let mut notes = Vec::new();
        notes.extend(caution(&derivation, path));
        for (k, says) in ineffective_retained(&derivation) {
            let place = loaded.retain.get(k).map(|span| {
                let (line, column) = loaded.sources.line_and_column(*span);
                let file = loaded.sources.files.get(span.file);
                let file = file.map_or_else(|| path.to_owned(), |f| f.path.display().to_string());
                format!("{file}:{line}:{column}")
            });
            let place = place.unwrap_or_else(|| path.to_owned());
            notes.push(RecordingNote::warning(format!("{place}: {says}")));
        }
        let found = derivation.identified_base();
        let stated = derivation.mechanism.identified_base.len();
        // Identified values are matched by expression: those of another geometry have no base
        // parameter here.
        if found.len() < stated {
            notes.push(RecordingNote::warning(message!(
                "{path}: {} of the {stated} values of `identified.base` belong to no base parameter of this model and are ignored; \
                 identify the model again and write the values with {}",
                stated - found.len(),
                Remedy::command(CommandName::Adopt)
            )));
        }
        let mut identified = vec![false; derivation.reduction.retained.len()];
        for (k, _) in found {
            identified[k] = true;
        }
        let stem = Path::new(path).file_stem();
        Ok(Model {
            name: stem.map_or_else(|| mechanism.name.clone(), |s| s.to_string_lossy().into_owned()),
            path: path.to_owned(),
            base: base(&derivation),
            values: derivation.nominal_base_values(),
            covariance: None,
            identified,
            signs: signs(mechanism, &loaded.kinds),
            loaded: Arc::new(loaded),
            derivation: Arc::new(derivation),
            notes,
            host: self.clone(),
            gravity_variants: GravityVariants::default(),
        })
    }
}

/// The base parameters, with the same expressions as on the page of equations.
fn base(derivation: &Derivation) -> Vec<BaseParameterEntry> {
    let mut base = derivation.base_parameters();
    for (k, one) in base.iter_mut().enumerate() {
        one.expression = base_expression(derivation, k).text();
    }
    base
}

/// A warning if the base parameters are valid only for the geometry of the file; `None` if they are valid for all
/// values of the constants.
fn caution(derivation: &Derivation, path: &str) -> Option<RecordingNote> {
    let says = derivation.reduction.method.caution()?;
    Some(RecordingNote::warning(format!("{path}: {says}")))
}

/// Entries of the list `retain` (products whose columns are to be kept) that cannot be retained, each with its index in
/// the list and the reason.
pub fn ineffective_retained(derivation: &Derivation) -> Vec<(usize, String)> {
    let reduction = &derivation.reduction;
    let mechanism = &derivation.mechanism;
    let mut says = Vec::new();
    for (k, powers) in mechanism.retain.iter().enumerate() {
        let wanted = ParameterMonomial(powers.iter().map(|(p, n)| (p.0, *n)).collect());
        let name = wanted.text(mechanism);
        // A product is retained, dependent, without effect, or unknown.
        let why = match reduction.products.iter().position(|p| *p == wanted) {
            Some(at) if reduction.retained.contains(&at) => continue,
            Some(_) => "its column depends on those of products that are retained before it",
            None if reduction.without_effect.contains(&wanted) => "it has no effect on the drives: its column is zero",
            None => "there is no such product in the equations",
        };
        says.push((k, format!("`{name}` of `retain` cannot be retained: {why}")));
    }
    says
}

/// The sign that each dynamic parameter must have: masses, moments of inertia, and what kinds of effects prescribe.
fn signs(mechanism: &Mechanism, kinds: &[EffectKind]) -> Vec<Sign> {
    // Masses and diagonal entries of the inertia must be positive.
    let mut signs = vec![Sign::Any; mechanism.parameters.len()];
    let mut positive = |exact: &ExactExpression| {
        if let Some(p) = multiple_of(exact) {
            signs[p.0] = Sign::Positive;
        }
    };
    for part in &mechanism.parts {
        let (PartInertia::AboutCentre { mass, inertia, .. } | PartInertia::Linear { mass, inertia, .. }) =
            &part.inertial;
        positive(mass);
        for i in [0, 3, 5] {
            positive(&inertia[i]);
        }
    }
    for lumped in &mechanism.lumped_masses {
        positive(&lumped.mass);
    }
    // Signs of effect parameters come from the kind; a kind that is unknown here prescribes none.
    for effect in &mechanism.effects {
        let Some(kind) = kinds.iter().find(|kind| kind.name == effect.kind) else {
            continue;
        };
        for term in &effect.terms {
            let known = kind.parameters.iter().find(|one| one.symbol == term.symbol);
            if let Some(parameter) = known.filter(|one| one.sign != Sign::Any) {
                signs[term.parameter.0] = parameter.sign;
            }
        }
    }
    signs
}

/// The parameter of which an expression is a positive rational multiple; `None` for other expressions.
fn multiple_of(exact: &ExactExpression) -> Option<ParameterIdx> {
    let is_positive = |exact: &ExactExpression| {
        let mut free = true;
        exact.for_each_symbol(&mut |_| free = false);
        free && exact.evaluate(&|_| 0.0) > 0.0
    };
    match exact {
        ExactExpression::Symbol(ModelSymbol::Parameter(p)) => Some(*p),
        ExactExpression::Quotient(above, below) if is_positive(below) => multiple_of(above),
        ExactExpression::Product(factors) => {
            let mut others = factors.iter().filter(|factor| !is_positive(factor));
            let one = others.next()?;
            others.next().is_none().then(|| multiple_of(one))?
        }
        _ => None,
    }
}

impl Model {
    /// The host with which the model was read.
    pub fn host(&self) -> &Host {
        &self.host
    }

    /// Text of the model file.
    pub fn text(&self) -> &str {
        self.loaded.sources.files.first().map_or("", |file| &file.text)
    }

    /// Paths of all files that were read for the model: its own file, files that it extends, and libraries of effects.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.loaded.sources.paths()
    }

    /// A warning if the base parameters are valid only for the geometry of this file; `None` if they are valid for all
    /// values of the constants. They depend on the geometry if they were computed numerically, or if constants were
    /// replaced by their values before the derivation.
    pub fn caution(&self) -> Option<RecordingNote> {
        caution(&self.derivation, &self.path)
    }

    /// Gravity vector in the base frame, evaluated with the constants of the file, m/s^2.
    pub fn gravity(&self) -> [f64; 3] {
        let mechanism = &self.derivation.mechanism;
        let value = |symbol| match symbol {
            ModelSymbol::Constant(c) => mechanism.constants[c.0].value,
            _ => 0.0,
        };
        mechanism.gravity.each_ref().map(|g| g.evaluate(&value))
    }

    /// The active coordinates: name, and `true` for an angle (rad) or `false` for a length (m).
    pub fn active_coordinate_types(&self) -> Vec<(String, bool)> {
        let coordinates = self.derivation.mechanism.coordinates.iter();
        coordinates
            .filter(|c| !c.passive)
            .map(|c| (c.name.clone(), c.motion.is_angle()))
            .collect()
    }

    /// Indices of the active coordinates that belong to joints, not to the pose of a free body.
    pub(crate) fn joint_coordinates(&self) -> Vec<usize> {
        let mechanism = &self.derivation.mechanism;
        let steps = mechanism.frames.iter().flat_map(|frame| &frame.steps);
        let bodies = steps.filter_map(|step| match step {
            FrameStep::Free(body) => Some(body),
            _ => None,
        });
        let free: Vec<usize> = bodies
            .flat_map(|body| body.position.iter().chain(&body.quaternion))
            .map(|i| i.0)
            .collect();
        let active = (0..mechanism.coordinates.len()).filter(|i| !mechanism.coordinates[*i].passive);
        let of_joints = active.enumerate().filter(|(_, i)| !free.contains(i));
        of_joints.map(|(place, _)| place).collect()
    }

    /// The products of dynamic parameters whose linear combination is the base parameter `k`, each with its
    /// coefficient, evaluated with the constants of the file.
    pub fn products_of(&self, k: usize) -> Vec<(&ParameterMonomial, f64)> {
        let reduction = &self.derivation.reduction;
        let constants = &self.derivation.mechanism.constants;
        let constants: Vec<f64> = constants.iter().map(|c| c.value).collect();
        // The retained product has the factor 1; the others come from the dependencies of columns, eq.
        // (6).
        let mut products = vec![(&reduction.products[reduction.retained[k]], 1.0)];
        for (line, factors) in reduction.dependencies.iter().zip(reduction.factors(&constants)) {
            if let Some(factor) = factors.get(&k) {
                products.push((&reduction.products[line.product], *factor));
            }
        }
        products
    }

    /// The sign that a dynamic parameter must have, such as that of a mass. `parameter` is its index in the mechanism.
    pub fn sign_of_parameter(&self, parameter: usize) -> Sign {
        self.signs[parameter]
    }

    /// Priors for some base parameters, with their nominal values as means. `among` contains indices of base
    /// parameters. Each product of parameters in a base parameter is assumed to have the relative standard deviation
    /// `sigma`. The products are assumed to be independent: the standard deviation of the prior is `sigma` times the
    /// root of the sum of squares of all summands. A base parameter gets no prior if all its summands are zero.
    ///
    /// The index in each prior is a position in `among`, not an index of a base parameter of the model.
    pub fn parameter_priors(&self, among: &[usize], sigma: f64) -> Vec<ParameterPrior> {
        let parameters = &self.derivation.mechanism.parameters;
        let values: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
        let priors = among.iter().enumerate().filter_map(|(i, k)| {
            // Summands may cancel, their uncertainties do not.
            let squares = self
                .products_of(*k)
                .iter()
                .map(|(product, factor)| (factor * product.value(&values)).powi(2))
                .sum::<f64>();
            (squares > 0.0).then(|| ParameterPrior {
                parameter: i,
                value: self.values[*k],
                std: sigma * squares.sqrt(),
            })
        });
        priors.collect()
    }

    /// Whether a base parameter contains no dynamic parameter, only constants and numbers, so that its value is known
    /// and not identified.
    pub fn is_known(&self, k: usize) -> bool {
        self.products_of(k).iter().all(|(p, _)| p.0.is_empty())
    }

    /// Whether a base parameter belongs to an effect, not to the bodies: its retained product contains a parameter of
    /// an effect. The retained product is the product whose regressor column is kept for this base parameter.
    pub fn is_effect(&self, k: usize) -> bool {
        let reduction = &self.derivation.reduction;
        let powers = &reduction.products[reduction.retained[k]].0;
        let effects = self.derivation.mechanism.effects.iter();
        let mut terms = effects.flat_map(|effect| &effect.terms);
        terms.any(|term| powers.iter().any(|(p, _)| *p == term.parameter.0))
    }

    /// The sign that a base parameter must have: that of its products if all of them must have the same sign, otherwise
    /// `Any`. `k` is its index in [`Model::base`].
    pub fn sign_of_base_parameter(&self, k: usize) -> Sign {
        // Even powers keep the sign; a factor of unknown sign leaves the product open.
        let sign_of = |(product, factor): &(&ParameterMonomial, f64)| {
            let mut is_positive = *factor > 0.0;
            for (p, power) in &product.0 {
                match self.signs[*p] {
                    _ if power % 2 == 0 => {}
                    Sign::Positive => {}
                    Sign::Negative => is_positive = !is_positive,
                    Sign::Any => return Sign::Any,
                }
            }
            if is_positive { Sign::Positive } else { Sign::Negative }
        };
        let products = self.products_of(k);
        let mut signs = products.iter().filter(|(_, factor)| *factor != 0.0).map(sign_of);
        let first = signs.next().unwrap_or(Sign::Any);
        if signs.all(|sign| sign == first) {
            first
        } else {
            Sign::Any
        }
    }

    /// Names of the active coordinates, in the order of the file: those that neither loops nor couplings determine.
    /// They are the independent coordinates of the mechanism; both words mean the same.
    pub fn active_coordinates(&self) -> Vec<String> {
        self.coordinates(false)
    }

    /// Names of the active coordinates that sensors measure: all but the signals of actuators, which may jump.
    pub(crate) fn measured_coordinates(&self) -> Vec<String> {
        let mechanism = &self.derivation.mechanism;
        let mut names = self.active_coordinates();
        let signals = mechanism.servo_forces.iter();
        let signals: Vec<&str> = signals
            .map(|force| mechanism.coordinates[force.signal.0].name.as_str())
            .collect();
        names.retain(|name| !signals.contains(&name.as_str()));
        names
    }

    /// Names of the passive coordinates, in the order of the file.
    pub fn passive_coordinates(&self) -> Vec<String> {
        self.coordinates(true)
    }

    /// Names of the passive or of the active coordinates.
    fn coordinates(&self, passive: bool) -> Vec<String> {
        let coordinates = self.derivation.mechanism.coordinates.iter();
        coordinates
            .filter(|c| c.passive == passive)
            .map(|c| c.name.clone())
            .collect()
    }

    /// Names of the regressor rows, in their order. Each row is that of a drive, or of a degree of freedom without an
    /// actuator ([`Model::undriven_rows`]). With more drives than degrees of freedom, each row is a degree of freedom, and the
    /// drives are in [`ModelSummary::drives`](crate::model::ModelSummary::drives).
    pub fn row_names(&self) -> Vec<String> {
        let drives = self.derivation.mechanism.drives.iter();
        drives.map(|d| d.name.clone()).collect()
    }

    /// Names of the regressor rows without an actuator, a subset of [`Model::row_names`], which lists all rows.
    pub fn undriven_rows(&self) -> Vec<String> {
        let drives = self.derivation.mechanism.drives.iter();
        let undriven = drives.filter(|drive| !drive.is_driven);
        undriven.map(|drive| drive.name.clone()).collect()
    }

    /// Unit of the force of a row of the regressor: `N` or `N m`. `row` is an index into [`Model::row_names`].
    pub fn force_unit(&self, row: usize) -> &'static str {
        let mechanism = &self.derivation.mechanism;
        mechanism.drives[row].kind.force_unit(&mechanism.coordinates)
    }

    /// The base parameters in the form of a fit file: name, expression, unit and nominal value.
    pub fn parameter_infos(&self) -> Vec<ParameterInfo> {
        self.base
            .iter()
            .enumerate()
            .map(|(k, base)| ParameterInfo {
                name: base.name.clone(),
                expression: base.expression.clone(),
                unit: base.unit.clone(),
                nominal: self.has_values(k).then(|| self.values[k]),
            })
            .collect()
    }

    /// The model with other values of its base parameters, such as those of a fit. `values` has the order of `base`,
    /// and its values count as identified.
    ///
    /// # Panics
    /// If the number of values differs from the number of base parameters.
    ///
    /// ```
    /// use modelmill::Model;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let values: Vec<f64> = arm.values.iter().map(|value| 1.1 * value).collect();
    /// assert_eq!(arm.with_values(&values).values, values);
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    #[must_use]
    pub fn with_values(&self, values: &[f64]) -> Self {
        assert_eq!(values.len(), self.base.len(), "one value per base parameter");
        Self {
            values: values.to_vec(),
            covariance: None,
            identified: vec![true; values.len()],
            ..self.clone()
        }
    }

    /// The model with the values of a fit, see [`Model::values_of`]. Gains of actuators get the values of the fit as nominal
    /// values.
    ///
    /// In a diagnosis with [`FixedParameters::All`](crate::diagnose::FixedParameters::All), a fit with a covariance is used
    /// as a prior; without one, the parameters are fixed at its values. Nothing else uses the covariance.
    #[must_use]
    pub fn with_fit(&self, fit: &BaseParameterValues) -> Self {
        let mut model = self.with_values(&fit.values);
        model.covariance = fit.covariance.clone().map(Arc::new);
        if !fit.gains.is_empty() {
            for parameter in &mut Arc::make_mut(&mut model.loaded).mechanism.parameters {
                if let Some((_, value)) = fit.gains.iter().find(|(name, _)| *name == parameter.name) {
                    (parameter.nominal, parameter.has_nominal) = (*value, true);
                }
            }
        }
        model
    }

    /// The information matrix of some base parameters, the inverse of their covariance; `None` without one.
    pub(crate) fn information(&self, parameters: &[usize]) -> Option<DMatrix<f64>> {
        let covariance = self.covariance.as_ref()?;
        let n = parameters.len();
        let part = DMatrix::from_fn(n, n, |i, j| covariance[(parameters[i], parameters[j])]);
        // Scaling to equal variances keeps the inverse accurate, since parameters differ by orders of magnitude.
        let scale = part.diagonal().map(|variance| variance.sqrt().recip());
        let scaled = DMatrix::from_fn(n, n, |i, j| part[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.cholesky()?.inverse();
        let information = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        information.iter().all(|x| x.is_finite()).then_some(information)
    }

    /// The model with the identified values of another model for all base parameters with the same expression.
    pub(crate) fn with_values_of(mut self, other: &Self) -> Self {
        for (k, base) in self.base.iter().enumerate() {
            let same = other.base.iter().position(|one| one.expression == base.expression);
            if let Some(i) = same.filter(|i| other.identified[*i]) {
                self.values[k] = other.values[i];
                self.identified[k] = true;
            }
        }
        self
    }

    /// The model with another host.
    pub(crate) fn with_host(mut self, host: &Host) -> Self {
        self.host = host.clone();
        self
    }

    /// Whether the value of a base parameter was identified (in a fit, or as `identified.base` in the file), and not
    /// computed from the nominal values of parameters.
    pub fn is_identified(&self, k: usize) -> bool {
        self.identified[k]
    }

    /// Whether the model has a value for a base parameter: an identified one, or one from the nominal values of the
    /// file. A base parameter is a sum of products of parameters. The file gives a value if all parameters of at least
    /// one of the products have a nominal value, which may be 0.
    pub fn has_values(&self, k: usize) -> bool {
        if self.identified[k] {
            return true;
        }
        // All products that are merged into this base parameter, also indirectly.
        let reduction = &self.derivation.reduction;
        let parameters = &self.derivation.mechanism.parameters;
        let is_in = |line: &&ColumnDependency| line.equals.iter().any(|(at, _)| *at == k);
        let mut lumped: Vec<usize> = (reduction.dependencies.iter().filter(is_in))
            .map(|line| line.product)
            .collect();
        // Products that depend via these are part of it as well.
        while let Some(more) = (reduction.dependencies.iter())
            .filter(|line| line.via.iter().any(|(product, _)| lumped.contains(product)))
            .map(|line| line.product)
            .find(|product| !lumped.contains(product))
        {
            lumped.push(more);
        }
        // A product has a nominal value if all its factors have one.
        std::iter::once(reduction.retained[k]).chain(lumped).any(|product| {
            let powers = &reduction.products[product].0;
            powers.iter().all(|(p, _)| parameters[*p].has_nominal)
        })
    }

    /// Whether passive coordinates (determined by loop closure) are solved for by Newton's method, because there is no
    /// closed form.
    pub fn has_iterative_loops(&self) -> bool {
        matches!(
            self.derivation.programs.passive_position,
            modelmill_codegen::PassivePosition::Newton(_)
        )
    }

    /// Kinds of the model's effects whose force depends on the load of the drive. A kind appears once for each effect
    /// of this kind in the file.
    pub fn load_dependent_effects(&self) -> Vec<&str> {
        let effects = self.derivation.mechanism.effects.iter();
        effects
            .filter(|effect| {
                effect.terms.iter().any(|term| {
                    term.expression
                        .mentions(&|symbol| symbol == ModelSymbol::Place(PlaceQuantity::Load))
                })
            })
            .map(|effect| effect.kind.as_str())
            .collect()
    }
}
