//! The fit of a model from that of its servo equations: base parameters with gains go in, the base parameters of the model
//! itself and the gains come out.
//!
//! Base parameters of both are sums of products of parameters. With values of the gains, those of the model are linear in
//! those of the servo equations. Where the signals determine only the sum of a gain and a parameter, such as `kd` and viscous
//! friction, the gain is assumed: it has its nominal value, or what the nominal value of the parameter leaves of the sum, or
//! else zero. The parameter is the rest, with the uncertainty of the sum.

use modelmill_identify::{ErrorFigures, FitDelay, FitFile, FitGain, FitParameter, ParameterStatus};
use nalgebra::{DMatrix, DVector};

use super::ServoModel;
use super::delay::ServoDelay;
use super::estimate::{ServoParameter, ServoStatus};
use super::gains::{GainProduct, nominal_value, product_of, retaining};

/// Largest relative error of the linear relation between both sets of base parameters (1): rounding.
const LARGEST_RELATION_ERROR: f64 = 1e-8;

/// The gains as linear functions of the base parameters of the servo equations: `values = select * base + constant`.
struct GainRelation {
    products: Vec<GainProduct>,
    select: DMatrix<f64>,
    constant: DVector<f64>,
}

impl ServoModel {
    /// The fit of the model without actuators, with the gains. `covariance` is that of `found`, zero for fixed values.
    /// `None` if only ratios are known.
    pub(super) fn model_fit(
        &self,
        found: &[ServoParameter],
        covariance: &DMatrix<f64>,
        delays: &[ServoDelay],
        samples: usize,
    ) -> Option<FitFile> {
        let is_absolute = |one: &ServoParameter| {
            [ServoStatus::Identified, ServoStatus::Known, ServoStatus::Undetermined].contains(&one.status)
        };
        if !found.iter().all(is_absolute) {
            return None;
        }
        let model = &self.model;
        let values = DVector::from_iterator(found.len(), found.iter().map(|one| one.value));
        let gains = self.gain_relation(&values);
        let gain_values = &gains.select * &values + &gains.constant;
        let (bodies, of_gains) = self.relation(&gains.products)?;
        let total = &bodies * (DMatrix::identity(found.len(), found.len()) - &of_gains * &gains.select);
        let base = &total * &values - &bodies * &of_gains * &gains.constant;
        let spread = &total * covariance * total.transpose();
        let is_open = |k: usize| {
            let used =
                |(i, one): (usize, &ServoParameter)| one.status == ServoStatus::Undetermined && total[(k, i)] != 0.0;
            found.iter().enumerate().any(used)
        };
        let infos = model.parameter_infos();
        let parameters: Vec<FitParameter> = (infos.into_iter().enumerate())
            .map(|(k, info)| {
                let status = if model.is_known(k) {
                    ParameterStatus::Known
                } else if is_open(k) {
                    ParameterStatus::Undetermined
                } else {
                    ParameterStatus::Identified
                };
                let std = spread[(k, k)].max(0.0).sqrt();
                FitParameter {
                    name: info.name,
                    expression: info.expression,
                    value: if model.is_known(k) { model.values[k] } else { base[k] },
                    std: (status == ParameterStatus::Identified && std.is_finite()).then_some(std),
                    classical_std: None,
                    effective_samples: None,
                    unit: info.unit,
                    nominal: info.nominal,
                    status,
                }
            })
            .collect();
        let is_complete = parameters
            .iter()
            .all(|one| one.std.is_some() || one.status == ParameterStatus::Known);
        let mechanism = &model.derivation.mechanism;
        let fitted_gains = (gains.products.iter().enumerate()).filter_map(|(g, product)| {
            let [(p, 1)] = product.as_slice() else {
                return None;
            };
            // A gain that the recordings do not determine has no value.
            let is_open = |(k, one): (usize, &ServoParameter)| {
                one.status == ServoStatus::Undetermined && gains.select[(g, k)] != 0.0
            };
            if found.iter().enumerate().any(is_open) {
                return None;
            }
            let row = gains.select.row(g);
            let variance = (row * covariance * row.transpose())[(0, 0)];
            Some(FitGain {
                name: mechanism.parameters[*p].name.clone(),
                value: gain_values[g],
                std: Some(variance.max(0.0).sqrt()).filter(|std| *std > 0.0 && std.is_finite()),
                unit: mechanism.parameters[*p].unit.clone(),
            })
        });
        Some(FitFile {
            model: model.name.clone(),
            samples,
            condition_number: None,
            scaled_condition_number: None,
            covariance: is_complete.then(|| spread.row_iter().map(|row| row.iter().copied().collect()).collect()),
            parameters,
            gains: fitted_gains.collect(),
            delays: self.fitted_delays(delays),
            constants: mechanism.constants.iter().map(|c| (c.name.clone(), c.value)).collect(),
            equation_sample: model.equation_sample(),
            undetermined: Vec::new(),
            fit: ErrorFigures::default(),
            check: None,
            data: Vec::new(),
            estimator: modelmill_identify::EstimatorOutput::default(),
        })
    }

    /// The estimated delays of drives with one actuator.
    fn fitted_delays(&self, delays: &[ServoDelay]) -> Vec<FitDelay> {
        let is_estimated = |one: &&ServoDelay| {
            let own = self
                .actuators()
                .iter()
                .filter(|actuator| self.drive_name(actuator) == one.drive);
            // An interval as wide as the delay itself determines nothing.
            let is_known = one
                .interval
                .is_some_and(|[low, high]| low > 0.0 && high - low < one.value);
            is_known && !one.is_open && own.count() == 1
        };
        let estimated = delays.iter().filter(is_estimated);
        let fitted = estimated.map(|one| FitDelay {
            drive: one.drive.clone(),
            value: one.value,
            std: one.std,
        });
        fitted.collect()
    }

    /// The gains of all actuators: their base parameters, less what these contain of other gains.
    fn gain_relation(&self, values: &DVector<f64>) -> GainRelation {
        let mut products: Vec<GainProduct> = Vec::new();
        for term in self.actuators().iter().flat_map(|actuator| &actuator.terms) {
            let product = product_of(term);
            if !product.is_empty() && !products.contains(&product) {
                products.push(product);
            }
        }
        let n = self.equations.base.len();
        let mut gains = GainRelation {
            select: DMatrix::zeros(products.len(), n),
            constant: DVector::zeros(products.len()),
            products,
        };
        let is_gain = |product: &GainProduct| gains.products.contains(product);
        let mechanism = &self.model.loaded.mechanism;
        // The base parameter from which a gain follows.
        let sources: Vec<Option<usize>> = (gains.products.iter())
            .map(|product| {
                let k = retaining(self, product)?;
                let others = self.equations.products_of(k);
                let is_shared = others.iter().any(|(other, _)| !is_gain(&other.0));
                (!is_shared).then_some(k)
            })
            .collect();
        // An assumed gain that stands for a sum is what nominal values of the other parameters leave of it.
        let remainder = |product: &GainProduct| -> Option<f64> {
            let k = retaining(self, product)?;
            let others = self.equations.products_of(k).into_iter().skip(1);
            let nominal = others.map(|(other, factor)| Some(factor * nominal_value(mechanism, &other.0)?));
            Some((values[k] - nominal.sum::<Option<f64>>()?).max(0.0))
        };
        for (g, _) in sources.iter().enumerate().filter(|(_, source)| source.is_none()) {
            let product = &gains.products[g];
            let assumed = nominal_value(mechanism, product).or_else(|| remainder(product));
            gains.constant[g] = assumed.unwrap_or(0.0);
        }
        for (g, k) in sources.iter().enumerate().filter_map(|(g, k)| Some((g, (*k)?))) {
            gains.select[(g, k)] = 1.0;
            for (other, factor) in self.equations.products_of(k).into_iter().skip(1) {
                let place = gains.products.iter().position(|one| *one == other.0);
                if let Some(place) = place.filter(|place| sources[*place].is_none()) {
                    gains.constant[g] -= factor * gains.constant[place];
                }
            }
        }
        gains
    }

    /// The base parameters of the model as `bodies * (base - of_gains * gains)`, with the base parameters of the servo
    /// equations. `None` if they do not follow from these.
    fn relation(&self, gains: &[GainProduct]) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let [n_servo, n_model] = [self.equations.base.len(), self.model.base.len()];
        let mut products: Vec<GainProduct> = Vec::new();
        let mut entries: Vec<(bool, usize, usize, f64)> = Vec::new();
        let mut of_gains = DMatrix::zeros(n_servo, gains.len());
        for (is_servo, model) in [(true, &self.equations), (false, &self.model)] {
            for k in 0..model.base.len() {
                for (product, factor) in model.products_of(k) {
                    if let Some(g) = gains.iter().position(|one| *one == product.0) {
                        if is_servo {
                            of_gains[(k, g)] += factor;
                        }
                        continue;
                    }
                    let known = products.iter().position(|one| *one == product.0);
                    let column = known.unwrap_or_else(|| {
                        products.push(product.0.clone());
                        products.len() - 1
                    });
                    entries.push((is_servo, k, column, factor));
                }
            }
        }
        let matrix = |of_servo: bool, n: usize| {
            let mut matrix = DMatrix::zeros(n, products.len());
            for (_, k, column, factor) in entries.iter().filter(|one| one.0 == of_servo) {
                matrix[(*k, *column)] += factor;
            }
            matrix
        };
        let [servo, model]: [DMatrix<f64>; 2] = [matrix(true, n_servo), matrix(false, n_model)];
        let scale = servo.amax().max(f64::MIN_POSITIVE);
        let bodies = &model * servo.clone().pseudo_inverse(1e-12 * scale).ok()?;
        // Rounding must not connect parameters that do not depend on each other.
        let bodies = bodies.map(|x| if x.abs() < 1e-12 { 0.0 } else { x });
        let error = (&bodies * servo - &model).amax();
        (error <= LARGEST_RELATION_ERROR * model.amax().max(1.0)).then_some((bodies, of_gains))
    }
}
