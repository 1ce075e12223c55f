//! Model files as commands see them: read, derived, with names for people and messages for faults.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use modelmill_codegen::review::base_expression;
use modelmill_codegen::{BaseParameter, Derivation, Monomial};
use modelmill_identify::estimate::Belief;
use modelmill_identify::{FitFile, ParameterInfo};
use modelmill_spec::{
    EffectKind, Exact, Inertial, Loaded, Mechanism, Motion, ParameterIdx, PlaceQuantity, Sign,
    Symbol,
};

use crate::args::ParameterSource;
use crate::failure::{Failure, Outcome};
use crate::progress::watched;
use crate::terminal;

/// A model file that was read and derived.
pub(crate) struct Model {
    /// The file's name without folder and extension; what the JSON calls the model.
    pub(crate) name: String,
    /// What messages call the file.
    pub(crate) path: String,
    /// The files it was read from.
    pub(crate) files: Vec<PathBuf>,
    /// Everything the mill knows about it.
    pub(crate) derivation: Derivation,
    /// The base parameters.
    pub(crate) base: Vec<BaseParameter>,
    /// Their values from the file's nominal values.
    pub(crate) nominal: Vec<f64>,
    /// The sign that each dynamic parameter must have.
    signs: Vec<Sign>,
}

/// Libraries of kinds of effects that the command line names, for every model that is read.
static LIBRARIES: OnceLock<Vec<PathBuf>> = OnceLock::new();

/// Sets the libraries that every model may use; once, before any is read.
pub(crate) fn use_libraries(paths: &[PathBuf]) {
    let _ = LIBRARIES.set(paths.to_vec());
}

/// The libraries that every model may use.
pub(crate) fn libraries() -> &'static [PathBuf] {
    LIBRARIES.get().map_or(&[], Vec::as_slice)
}

/// Reads a model file; warnings go to standard error.
pub(crate) fn load(path: &Path) -> Outcome<Loaded> {
    let loaded = load_quietly(path)?;
    if !loaded.warnings.is_empty() {
        terminal::say(loaded.render(terminal::errors_in_colour()).trim_end());
    }
    Ok(loaded)
}

/// Reads a model file and keeps its warnings.
pub(crate) fn load_quietly(path: &Path) -> Outcome<Loaded> {
    if path.is_dir() {
        return Err(Failure::Input(format!(
            "{} is a folder; a model file is expected{}",
            path.display(),
            nearby(path)
        )));
    }
    if !path.exists() {
        return Err(Failure::Input(format!(
            "there is no file {}; the path of a model file (TOML) is expected{}",
            path.display(),
            nearby(path)
        )));
    }
    watched(&format!("reading {}", path.display()), 0, |_| {
        modelmill_spec::load_file_with(path, libraries())
    })
    .map_err(|failure| Failure::Rendered(failure.render(terminal::errors_in_colour())))
}

/// Reads and derives a model file.
pub(crate) fn derive(path: &Path) -> Outcome<Model> {
    let loaded = load(path)?;
    derive_loaded(&path.display().to_string(), &loaded)
}

/// Derives a model that was read from `path`.
pub(crate) fn derive_loaded(path: &str, loaded: &Loaded) -> Outcome<Model> {
    let mechanism = &loaded.mechanism;
    let derivation = watched(&format!("deriving {}", mechanism.name), 0, |_| {
        modelmill_codegen::derive(mechanism)
    })
    .map_err(|error| Failure::Input(format!("{path}: {error}")))?;
    for (k, says) in retained_in_vain(&derivation) {
        let place = loaded.retain.get(k).map(|span| {
            let (line, column) = loaded.sources.line_and_column(*span);
            let file = loaded.sources.files.get(span.file);
            let file = file.map_or_else(|| path.to_owned(), |f| f.path.display().to_string());
            format!("{file}:{line}:{column}")
        });
        let place = place.unwrap_or_else(|| path.to_owned());
        terminal::warn(&format!("{place}: {says}"));
    }
    let stem = Path::new(path).file_stem();
    Ok(Model {
        name: stem.map_or_else(
            || mechanism.name.clone(),
            |s| s.to_string_lossy().into_owned(),
        ),
        path: path.to_owned(),
        files: loaded.sources.paths().map(Path::to_owned).collect(),
        base: base(&derivation),
        nominal: derivation.nominal_base_values(),
        signs: signs(mechanism, &loaded.kinds),
        derivation,
    })
}

/// The base parameters, with expressions as the page of equations writes them out.
fn base(derivation: &Derivation) -> Vec<BaseParameter> {
    let mut base = derivation.base_parameters();
    for (k, one) in base.iter_mut().enumerate() {
        one.expression = base_expression(derivation, k).text();
    }
    base
}

/// What `retain` asks for that cannot be, in words, by its place in the list.
pub(crate) fn retained_in_vain(derivation: &Derivation) -> Vec<(usize, String)> {
    let reduction = &derivation.reduction;
    let mechanism = &derivation.mechanism;
    let mut says = Vec::new();
    for (k, powers) in mechanism.retain.iter().enumerate() {
        let wanted = Monomial(powers.iter().map(|(p, n)| (p.0, *n)).collect());
        let name = wanted.text(mechanism);
        let why = match reduction.products.iter().position(|p| *p == wanted) {
            Some(at) if reduction.retained.contains(&at) => continue,
            Some(_) => "its column depends on those of products that are retained before it",
            None if reduction.without_effect.contains(&wanted) => {
                "it has no effect on the drives: its column is zero"
            }
            None => "there is no such product in the equations",
        };
        says.push((k, format!("`{name}` of `retain` cannot be retained: {why}")));
    }
    says
}

/// The sign that each dynamic parameter must have: masses, moments of inertia, and what kinds of effects say.
fn signs(mechanism: &Mechanism, kinds: &[EffectKind]) -> Vec<Sign> {
    let mut signs = vec![Sign::Any; mechanism.parameters.len()];
    let mut positive = |exact: &Exact| {
        if let Some(p) = multiple_of(exact) {
            signs[p.0] = Sign::Positive;
        }
    };
    for part in &mechanism.parts {
        let (Inertial::AboutCentre { mass, inertia, .. } | Inertial::Linear { mass, inertia, .. }) =
            &part.inertial;
        positive(mass);
        for i in [0, 3, 5] {
            positive(&inertia[i]);
        }
    }
    for lumped in &mechanism.lumped_masses {
        positive(&lumped.mass);
    }
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

/// The parameter of which an expression is a positive rational multiple.
fn multiple_of(exact: &Exact) -> Option<ParameterIdx> {
    let is_positive = |exact: &Exact| {
        let mut free = true;
        exact.for_each_symbol(&mut |_| free = false);
        free && exact.evaluate(&|_| 0.0) > 0.0
    };
    match exact {
        Exact::Symbol(Symbol::Parameter(p)) => Some(*p),
        Exact::Quotient(above, below) if is_positive(below) => multiple_of(above),
        Exact::Product(factors) => {
            let mut others = factors.iter().filter(|factor| !is_positive(factor));
            let one = others.next()?;
            others.next().is_none().then(|| multiple_of(one))?
        }
        _ => None,
    }
}

impl Model {
    /// Gravity in the frame of the base with the constants of the file, m/s^2.
    pub(crate) fn gravity(&self) -> [f64; 3] {
        let mechanism = &self.derivation.mechanism;
        let value = |symbol| match symbol {
            Symbol::Constant(c) => mechanism.constants[c.0].value,
            _ => 0.0,
        };
        mechanism.gravity.each_ref().map(|g| g.evaluate(&value))
    }

    /// Active coordinates with whether they are angles.
    pub(crate) fn motions(&self) -> Vec<(String, bool)> {
        let coordinates = self.derivation.mechanism.coordinates.iter();
        coordinates
            .filter(|c| !c.passive)
            .map(|c| (c.name.clone(), c.motion == Motion::Revolute))
            .collect()
    }

    /// Products that a base parameter consists of, with what they are multiplied by for the file's constants.
    pub(crate) fn products_of(&self, k: usize) -> Vec<(&Monomial, f64)> {
        let reduction = &self.derivation.reduction;
        let constants = &self.derivation.mechanism.constants;
        let constants: Vec<f64> = constants.iter().map(|c| c.value).collect();
        let mut products = vec![(&reduction.products[reduction.retained[k]], 1.0)];
        for line in &reduction.dependencies {
            for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
                let factor = factor.value_f64(&constants);
                products.push((&reduction.products[line.product], factor));
            }
        }
        products
    }

    /// The sign that a dynamic parameter must have.
    pub(crate) fn sign_of(&self, parameter: usize) -> Sign {
        self.signs[parameter]
    }

    /// What the nominal values say beforehand of some base parameters, each product of parameters with the relative standard
    /// deviation `sigma`; nothing of those that the file gives no value for.
    pub(crate) fn beliefs(&self, among: &[usize], sigma: f64) -> Vec<Belief> {
        let parameters = &self.derivation.mechanism.parameters;
        let values: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
        let believed = among.iter().enumerate().filter_map(|(i, k)| {
            // Summands may cancel, their uncertainties do not.
            let squares = self
                .products_of(*k)
                .iter()
                .map(|(product, factor)| (factor * product.value(&values)).powi(2))
                .sum::<f64>();
            (squares > 0.0).then(|| Belief {
                parameter: i,
                value: self.nominal[*k],
                std: sigma * squares.sqrt(),
            })
        });
        believed.collect()
    }

    /// Whether a base parameter consists of numbers of the model file only, so that there is nothing to identify.
    pub(crate) fn is_known(&self, k: usize) -> bool {
        self.products_of(k).iter().all(|(p, _)| p.0.is_empty())
    }

    /// Whether a base parameter belongs to an effect rather than to the bodies.
    pub(crate) fn is_effect(&self, k: usize) -> bool {
        let reduction = &self.derivation.reduction;
        let powers = &reduction.products[reduction.retained[k]].0;
        let effects = self.derivation.mechanism.effects.iter();
        let mut terms = effects.flat_map(|effect| &effect.terms);
        terms.any(|term| powers.iter().any(|(p, _)| *p == term.parameter.0))
    }

    /// The sign that a base parameter must have, where all of its summands must have the same.
    pub(crate) fn sign(&self, k: usize) -> Sign {
        let sign_of = |(product, factor): &(&Monomial, f64)| {
            let mut is_positive = *factor > 0.0;
            for (p, power) in &product.0 {
                match self.signs[*p] {
                    _ if power % 2 == 0 => {}
                    Sign::Positive => {}
                    Sign::Negative => is_positive = !is_positive,
                    Sign::Any => return Sign::Any,
                }
            }
            if is_positive {
                Sign::Positive
            } else {
                Sign::Negative
            }
        };
        let products = self.products_of(k);
        let mut signs = products
            .iter()
            .filter(|(_, factor)| *factor != 0.0)
            .map(sign_of);
        let first = signs.next().unwrap_or(Sign::Any);
        if signs.all(|sign| sign == first) {
            first
        } else {
            Sign::Any
        }
    }

    /// Names of the active coordinates, in the order of the file.
    pub(crate) fn active(&self) -> Vec<String> {
        self.coordinates(false)
    }

    /// Names of the passive coordinates, in the order of the file.
    pub(crate) fn passive(&self) -> Vec<String> {
        self.coordinates(true)
    }

    fn coordinates(&self, passive: bool) -> Vec<String> {
        let coordinates = self.derivation.mechanism.coordinates.iter();
        coordinates
            .filter(|c| c.passive == passive)
            .map(|c| c.name.clone())
            .collect()
    }

    /// Names of the drives.
    pub(crate) fn drives(&self) -> Vec<String> {
        let drives = self.derivation.mechanism.drives.iter();
        drives.map(|d| d.name.clone()).collect()
    }

    /// The base parameters as a fit describes them.
    pub(crate) fn infos(&self) -> Vec<ParameterInfo> {
        self.base
            .iter()
            .enumerate()
            .map(|(k, base)| ParameterInfo {
                name: base.name.clone(),
                expression: base.expression.clone(),
                unit: base.unit.clone(),
                nominal: self.has_nominal(k).then(|| self.nominal[k]),
            })
            .collect()
    }

    /// Whether the file gives a nominal value for anything that a base parameter consists of.
    pub(crate) fn has_nominal(&self, k: usize) -> bool {
        let reduction = &self.derivation.reduction;
        let parameters = &self.derivation.mechanism.parameters;
        let lumped = reduction
            .dependencies
            .iter()
            .filter(|line| line.equals.iter().any(|(at, _)| *at == k))
            .map(|line| line.product);
        std::iter::once(reduction.retained[k])
            .chain(lumped)
            .any(|product| {
                let powers = &reduction.products[product].0;
                powers.iter().all(|(p, _)| parameters[*p].nominal != 0.0)
            })
    }

    /// Values of the base parameters from where `--parameters` says.
    pub(crate) fn values(&self, source: &ParameterSource) -> Outcome<Vec<f64>> {
        let ParameterSource::Fit(path) = source else {
            let without: Vec<&str> = (0..self.base.len())
                .filter(|k| !self.has_nominal(*k))
                .map(|k| self.base[k].expression.as_str())
                .collect();
            if !without.is_empty() {
                terminal::warn(&format!(
                    "{} gives no nominal value for {}; 0 is taken",
                    self.path,
                    without.join(", ")
                ));
            }
            return Ok(self.nominal.clone());
        };
        let names: Vec<(&str, &str)> = self
            .base
            .iter()
            .map(|base| (base.name.as_str(), base.expression.as_str()))
            .collect();
        let file = path.display().to_string();
        let fit = FitFile::read(path).map_err(Failure::input)?;
        let values = fit.values_for(&names, &file).map_err(Failure::input)?;
        let constants = self.derivation.mechanism.constants.iter();
        let constants: Vec<(&str, f64)> = constants.map(|c| (c.name.as_str(), c.value)).collect();
        let others = fit
            .other_constants(&constants, &file)
            .map_err(Failure::input)?;
        for (name, then, now) in others {
            terminal::warn(&format!(
                "{file} was made with {name} = {then}, but {} has {name} = {now}; identify again unless this is meant",
                self.path
            ));
        }
        Ok(values)
    }

    /// Effects whose force depends on the load of the drive.
    pub(crate) fn load_dependent(&self) -> Vec<&str> {
        let effects = self.derivation.mechanism.effects.iter();
        effects
            .filter(|effect| {
                effect.terms.iter().any(|term| {
                    term.expression
                        .mentions(&|symbol| symbol == Symbol::Place(PlaceQuantity::Load))
                })
            })
            .map(|effect| effect.kind.as_str())
            .collect()
    }
}

/// Model files around a path that led nowhere, as a sentence for the end of a message.
fn nearby(path: &Path) -> String {
    let own = if path.is_dir() {
        path
    } else {
        path.parent().unwrap_or(Path::new(""))
    };
    let folders = [
        own,
        Path::new("models"),
        Path::new("model-spec/models"),
        Path::new(""),
    ];
    for folder in folders {
        let here = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let mut found: Vec<String> = std::fs::read_dir(here)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| folder.join(entry.file_name()))
            .filter(|file| is_model(file))
            .map(|file| file.display().to_string())
            .collect();
        if found.is_empty() {
            continue;
        }
        found.sort();
        let more = found.len().saturating_sub(24);
        found.truncate(24);
        let more = if more > 0 {
            format!("\n  and {more} more")
        } else {
            String::new()
        };
        return format!("; model files nearby:\n  {}{more}", found.join("\n  "));
    }
    "; `modelmill tour` shows what a model file gives".to_owned()
}

/// Whether a file looks like a model: TOML with a line that gives the version of the schema.
fn is_model(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "toml")
        && std::fs::metadata(path).is_ok_and(|m| m.is_file() && m.len() < 1 << 20)
        && std::fs::read_to_string(path).is_ok_and(|text| {
            text.lines()
                .filter_map(|line| line.split_once('='))
                .any(|(key, _)| key.trim() == "schema")
        })
}
