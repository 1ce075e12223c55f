//! The two balances as sums of terms, and their equations with vectors and by components.

use modelmill_spec::PointIdx;

use super::geometry::BodyGeometry;
use super::vectors::{AXES, VectorComponents, VectorId, VectorTable};
use super::{BalanceEquation, BalanceVector, BodyBalances};
use crate::expr::Rational;
use crate::expr::print::PrintedFormula;
use crate::expr::vector::{self, SymbolicVector};
use crate::review::document::PageEquation;
use crate::{Derivation, DeriveError};

/// A term of a balance: a vector with a factor, or its moment about the origin of the body.
#[derive(Clone, Debug)]
pub(super) struct BalanceTerm {
    /// Whether it is subtracted.
    is_negative: bool,
    /// Scalar factor.
    factor: PrintedFormula,
    /// The vector.
    vector: VectorId,
    /// Lever arm, for moments of forces.
    arm: Option<VectorId>,
    /// The formula to show in place of the vector.
    pub(super) shown: Option<PrintedFormula>,
}

impl BalanceTerm {
    /// The vector itself.
    pub(super) fn force(vector: VectorId) -> Self {
        Self {
            is_negative: false,
            factor: PrintedFormula::integer(1),
            vector,
            arm: None,
            shown: None,
        }
    }

    /// The vector times a scalar.
    pub(super) fn with_factor(mut self, factor: PrintedFormula) -> Self {
        self.factor = factor;
        self
    }

    /// The moment of the vector at a lever arm.
    pub(super) fn with_arm(mut self, arm: VectorId) -> Self {
        self.arm = Some(arm);
        self
    }

    /// The opposite.
    pub(super) fn negate(mut self) -> Self {
        self.is_negative = !self.is_negative;
        self
    }

    /// The term with its sign and factor.
    fn weigh(&self, formula: PrintedFormula) -> PrintedFormula {
        let sign = if self.is_negative {
            Rational::MINUS_ONE
        } else {
            Rational::ONE
        };
        PrintedFormula::product(sign, [self.factor.clone(), formula])
    }
}

/// One side of both balances.
#[derive(Clone, Debug, Default)]
pub(super) struct BalanceSide {
    /// Terms of the balance of forces.
    pub(super) forces: Vec<BalanceTerm>,
    /// Terms of the balance of moments.
    pub(super) moments: Vec<BalanceTerm>,
}

/// A place at which the body is cut, for the picture: forces and moments with whether the body receives the opposite.
pub(super) struct CutPlace {
    /// Lever arm from the origin of the body, m.
    pub(super) at: SymbolicVector,
    /// The vectors that act there.
    pub(super) forces: Vec<(VectorId, bool)>,
}

/// The unknown force along a drive between two points, N.
pub(super) struct AxialForce {
    /// Its symbol.
    pub(super) symbol: String,
    /// What it is.
    pub(super) meaning: String,
    /// Name of the drive.
    pub(super) drive: String,
    /// The unit vector along the drive.
    pub(super) along: VectorId,
}

/// Balances of a body while they are collected.
pub(super) struct BalanceEquations<'a> {
    /// The body.
    pub(super) geometry: BodyGeometry<'a>,
    /// All vectors.
    pub(super) vectors: VectorTable,
    /// Forces along drives.
    pub(super) scalars: Vec<AxialForce>,
    /// Masses with the lever arms at which their weight is drawn.
    pub(super) weights: Vec<(PrintedFormula, VectorId)>,
    /// Acceleration of gravity; none if there is no gravity.
    pub(super) gravity: Option<VectorId>,
    /// Rates of momentum and angular momentum.
    pub(super) inertia: BalanceSide,
    /// Forces and moments on the body.
    pub(super) load: BalanceSide,
    /// Places at which the body is cut.
    pub(super) cuts: Vec<CutPlace>,
    /// Number of masses.
    pub(super) masses: usize,
    /// Lever arm and acceleration of the last mass.
    pub(super) last_point: Option<[VectorId; 2]>,
    /// Whether a mass is at different points in the two balances.
    pub(super) has_two_points: bool,
    /// Lever arms of named points.
    pub(super) point_arms: Vec<(PointIdx, VectorId)>,
    /// Symbols of angular acceleration and angular velocity.
    angular: [String; 2],
    /// Inertia matrices: symbol and meaning.
    pub(super) matrices: Vec<(String, String)>,
    /// Components of all vectors.
    components: Vec<[PrintedFormula; 3]>,
    /// Equations that define components.
    pub(super) definitions: Vec<PageEquation>,
    /// The balance of forces and of moments, with vectors.
    pub(super) with_vectors: Vec<PageEquation>,
    /// The same by components.
    pub(super) by_components: Vec<PageEquation>,
}

impl<'a> BalanceEquations<'a> {
    /// Collects and writes the balances of a body.
    pub(super) fn new(derivation: &Derivation, mut geometry: BodyGeometry<'a>) -> Result<Self, DeriveError> {
        let mechanism = &derivation.mechanism;
        let mut vectors = VectorTable::new(mechanism, geometry.force_axes(), geometry.moment_axes());
        let angular = ["alpha", "omega"].map(|name| vectors.unique_name(name));
        let gravity = geometry.gravity();
        let gravity = (geometry.equations.gravity != vector::ZERO).then(|| {
            let meaning = "acceleration of gravity".to_owned();
            vectors.add("a_g", "m/s^2", VectorComponents::Known(gravity), meaning)
        });
        let mut equations = Self {
            geometry,
            vectors,
            scalars: Vec::new(),
            weights: Vec::new(),
            gravity,
            inertia: BalanceSide::default(),
            load: BalanceSide::default(),
            cuts: Vec::new(),
            masses: 0,
            last_point: None,
            has_two_points: false,
            point_arms: Vec::new(),
            angular,
            matrices: Vec::new(),
            components: Vec::new(),
            definitions: Vec::new(),
            with_vectors: Vec::new(),
            by_components: Vec::new(),
        };
        equations.add_connections()?;
        equations.add_masses()?;
        equations.write(derivation);
        Ok(equations)
    }

    /// Angular acceleration and angular velocity of the body.
    pub(super) fn angular_symbols(&self) -> [PrintedFormula; 2] {
        self.angular.each_ref().map(|name| PrintedFormula::name(&**name))
    }

    /// Writes all equations.
    fn write(&mut self, derivation: &Derivation) {
        let (components, definitions) = self
            .vectors
            .write_components(&self.geometry.graph, &derivation.mechanism);
        self.definitions = definitions;
        let sides = [&self.inertia.forces, &self.load.forces];
        let forces = sides.map(|terms| self.write_vectors(terms));
        let sides = [&self.inertia.moments, &self.load.moments];
        let moments = sides.map(|terms| self.write_vectors(terms));
        self.with_vectors = vec![page_equation("B1", "N", forces), page_equation("B2", "N m", moments)];
        let along = |terms: &[BalanceTerm], k: usize| write_component(terms, &components, k);
        let mut written = Vec::new();
        for k in self.geometry.force_axes() {
            let sides = [&self.inertia.forces, &self.load.forces].map(|terms| along(terms, k));
            written.push(page_equation(&format!("B1{}", AXES[k]), "N", sides));
        }
        for k in self.geometry.moment_axes() {
            let sides = [&self.inertia.moments, &self.load.moments].map(|terms| along(terms, k));
            written.push(page_equation(&format!("B2{}", AXES[k]), "N m", sides));
        }
        self.by_components = written;
        self.components = components;
    }

    /// Quantities without components: symbol, unit and meaning.
    pub(super) fn described(&self) -> Vec<(&str, &'static str, &str)> {
        let [alpha, omega] = &self.angular;
        let matrices = self.matrices.iter();
        let matrices: Vec<_> = matrices
            .map(|(symbol, meaning)| (symbol.as_str(), "kg m^2", meaning.as_str()))
            .collect();
        // Without inertia no rotation occurs in the equations.
        let has_rotation = !matrices.is_empty() || self.vectors.vectors.iter().any(|v| v.unit == "kg m");
        let mut described = Vec::new();
        if has_rotation {
            described.push((omega.as_str(), "rad/s", "angular velocity of the body"));
            described.push((alpha.as_str(), "rad/s^2", "angular acceleration of the body"));
        }
        described.extend(matrices);
        described
    }

    /// One side of a balance with vectors.
    fn write_vectors(&self, terms: &[BalanceTerm]) -> PrintedFormula {
        let written = terms.iter().map(|term| {
            let symbol = term.shown.clone().unwrap_or_else(|| self.vectors.symbol(term.vector));
            let vector = match term.arm {
                Some(arm) => PrintedFormula::cross(self.vectors.symbol(arm), symbol),
                None => symbol,
            };
            term.weigh(vector)
        });
        PrintedFormula::sum(written)
    }

    /// The balances as texts.
    pub(super) fn texts(&self, derivation: &Derivation) -> BodyBalances {
        let mechanism = &derivation.mechanism;
        let text = |equation: &PageEquation| BalanceEquation {
            tag: equation.tag.clone(),
            left: equation.left.text(),
            right: equation.right.text(),
        };
        let vectors = self.vectors.vectors.iter().zip(&self.components);
        let vectors = vectors.map(|(vector, components)| BalanceVector {
            symbol: vector.symbol.clone(),
            meaning: vector.meaning.clone(),
            unit: vector.unit.to_owned(),
            components: components.iter().map(PrintedFormula::text).collect(),
            transmitted_by: vector.transmitted_by.clone(),
        });
        let described = self
            .described()
            .into_iter()
            .map(|(symbol, unit, meaning)| BalanceVector {
                symbol: symbol.to_owned(),
                meaning: meaning.to_owned(),
                unit: unit.to_owned(),
                components: Vec::new(),
                transmitted_by: None,
            });
        let scalars = self.scalars.iter().map(|scalar| BalanceVector {
            symbol: scalar.symbol.clone(),
            meaning: scalar.meaning.clone(),
            unit: "N".to_owned(),
            components: Vec::new(),
            transmitted_by: Some(scalar.drive.clone()),
        });
        let frames = self.geometry.frames().into_iter();
        BodyBalances {
            model: mechanism.name.clone(),
            part: self.geometry.part.clone(),
            frames: frames.map(|f| mechanism.frames[f].name.clone()).collect(),
            axes: self.geometry.axes_name(),
            is_planar: self.geometry.normal.is_some(),
            vectors: vectors.chain(scalars).chain(described).collect(),
            definitions: self.definitions.iter().map(text).collect(),
            forces: text(&self.with_vectors[0]),
            moments: text(&self.with_vectors[1]),
            components: self.by_components.iter().map(text).collect(),
        }
    }
}

/// An equation with its tag and unit.
fn page_equation(tag: &str, unit: &str, [left, right]: [PrintedFormula; 2]) -> PageEquation {
    PageEquation {
        left,
        right,
        tag: tag.to_owned(),
        unit: Some(unit.to_owned()),
    }
}

/// One component of a side of a balance.
fn write_component(terms: &[BalanceTerm], components: &[[PrintedFormula; 3]], k: usize) -> PrintedFormula {
    let written = terms.iter().map(|term| {
        let v = &components[term.vector.0];
        let Some(arm) = term.arm else {
            return term.weigh(v[k].clone());
        };
        let r = &components[arm.0];
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let product =
            |a: &PrintedFormula, b: &PrintedFormula| PrintedFormula::product(Rational::ONE, [a.clone(), b.clone()]);
        let moment = PrintedFormula::sum([product(&r[i], &v[j]), product(&r[j], &v[i]).negate()]);
        term.weigh(moment)
    });
    PrintedFormula::sum(written)
}
