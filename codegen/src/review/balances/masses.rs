//! Masses of a body: rigid bodies, lumped masses, and what effects add, each with its terms of inertia and its weight.

use modelmill_spec::{EffectPlace, ExactExpression, FrameIdx, LumpedMass, ModelPart, ModelSymbol, PartInertia};

use super::equations::{BalanceEquations, BalanceTerm};
use super::vectors::{VectorComponents, VectorId};
use crate::DeriveError;
use crate::expr::print::{PrintedFormula, exact_formula};
use crate::expr::{Graph, Rational, vector};

impl BalanceEquations<'_> {
    /// Adds all masses of the body.
    pub(super) fn add_masses(&mut self) -> Result<(), DeriveError> {
        let mechanism = self.geometry.mechanism;
        let effects = &mechanism.effects;
        let parts = effects.iter().flat_map(|effect| &effect.bodies.parts);
        for part in mechanism.parts.iter().chain(parts) {
            if self.carries(part.frame) {
                self.add_part(part)?;
            }
        }
        let lumps = effects.iter().flat_map(|effect| &effect.bodies.lumped_masses);
        for lump in mechanism.lumped_masses.iter().chain(lumps) {
            if self.carries(lump.frame) {
                self.add_lump(lump)?;
            }
        }
        for effect in effects.iter().filter(|effect| effect.mechanics.is_none()) {
            for place in &effect.places {
                let EffectPlace::Point(point) = place else { continue };
                let point = &mechanism.points[point.0];
                if !self.carries(point.frame) {
                    continue;
                }
                // Effects at points add masses there.
                for term in &effect.terms {
                    let parameter = ExactExpression::Symbol(ModelSymbol::Parameter(term.parameter));
                    let mass = ExactExpression::Product(vec![parameter, term.expression.clone()]);
                    let mass = exact_formula(mechanism, &mass);
                    let says = format!("the mass of effect {} at {}", effect.kind, point.name);
                    self.add_point_mass(&mass, point.frame, [&point.at, &point.at], &says)?;
                }
            }
        }
        Ok(())
    }

    /// Whether the body carries a frame.
    fn carries(&self, frame: FrameIdx) -> bool {
        self.geometry.has_link(self.geometry.tree().link_of(frame))
    }

    /// Adds a rigid body.
    fn add_part(&mut self, part: &ModelPart) -> Result<(), DeriveError> {
        let mechanism = self.geometry.mechanism;
        let link = self.geometry.tree().link_of(part.frame).expect("carried by the body");
        match &part.inertial {
            PartInertia::AboutCentre { mass, centre, inertia } => {
                let mass = exact_formula(mechanism, mass);
                let says = format!("the centre of mass of {}", part.name);
                let n = self.add_point_mass(&mass, part.frame, [centre, centre], &says)?;
                self.add_inertia(n, link, inertia, &format!("{} about its centre of mass", part.name))
            }
            PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } => self.add_linear_part(part, link, mass, first_moment, inertia),
        }
    }

    /// Adds a part that is given by its first moment and its inertia about the origin of its frame.
    fn add_linear_part(
        &mut self,
        part: &ModelPart,
        link: usize,
        mass: &ExactExpression,
        first_moment: &[ExactExpression; 3],
        inertia: &[ExactExpression; 6],
    ) -> Result<(), DeriveError> {
        let name = &part.name;
        let frame = &self.geometry.mechanism.frames[part.frame.0].name;
        let origin = format!("the origin of frame {frame}");
        let mass = exact_formula(self.geometry.mechanism, mass);
        // Terms of the mass at the origin of the frame.
        let zero = [0; 3].map(|_| ExactExpression::Rational(Rational::ZERO.to_big()));
        let n = self.add_point_mass(&mass, part.frame, [&zero, &zero], &origin)?;
        let moment = self.geometry.vector(first_moment)?;
        if moment != vector::ZERO {
            let [arm, acceleration] = self.last_point.expect("a point was added");
            let fixed = self.geometry.express_in_body_axes(&moment, Some(link));
            let meaning = format!("first moment of mass of {name} about {origin}");
            let s = self
                .vectors
                .add(&format!("s_c{n}"), "kg m", VectorComponents::Known(fixed), meaning);
            let swung = self.geometry.first_moment_derivative(link, &moment);
            let meaning = format!("second time derivative of the first moment of {name} because of its rotation");
            let j = self
                .vectors
                .add(&format!("j_c{n}"), "kg m/s^2", VectorComponents::Known(swung), meaning);
            // The formula of the derivative with vectors.
            let [alpha, omega] = self.angular_symbols();
            let symbol = || self.vectors.symbol(s);
            let inner = PrintedFormula::cross(omega.clone(), symbol());
            let shown = [
                PrintedFormula::cross(alpha, symbol()),
                PrintedFormula::cross(omega, inner),
            ];
            let mut term = BalanceTerm::force(j);
            term.shown = Some(PrintedFormula::sum(shown));
            self.inertia.forces.push(term);
            if !self.vectors.is_zero(arm) {
                self.inertia.moments.push(BalanceTerm::force(j).with_arm(arm));
            }
            self.inertia.moments.push(BalanceTerm::force(acceleration).with_arm(s));
            if let Some(gravity) = self.gravity {
                self.load.moments.push(BalanceTerm::force(gravity).with_arm(s));
            }
        }
        self.add_inertia(n, link, inertia, &format!("{name} about {origin}"))
    }

    /// Adds a lumped mass, which may be at two points in the two balances.
    fn add_lump(&mut self, lump: &LumpedMass) -> Result<(), DeriveError> {
        let share = Rational::from(lump.share.clone());
        let mass = exact_formula(self.geometry.mechanism, &lump.mass);
        let says = format!(
            "the lumped mass {}",
            PrintedFormula::product(share.clone(), [mass.clone()])
        );
        let mass = PrintedFormula::product(share, [mass]);
        self.add_point_mass(&mass, lump.frame, [&lump.force_at, &lump.moment_at], &says)?;
        Ok(())
    }

    /// Adds a mass at its points in the balance of forces and in the balance of moments; returns its number.
    fn add_point_mass(
        &mut self,
        mass: &PrintedFormula,
        frame: FrameIdx,
        at: [&[ExactExpression; 3]; 2],
        says: &str,
    ) -> Result<usize, DeriveError> {
        self.masses += 1;
        let n = self.masses;
        let two_points = at[0] != at[1];
        let named = |what: &str| {
            if two_points {
                format!("{says} in the balance of {what}")
            } else {
                says.to_owned()
            }
        };
        let [_, acceleration] = self.add_mass_point(&format!("c{n}"), frame, at[0], &named("forces"))?;
        let force_point = self.last_point.expect("a point was added");
        // Moments of a mass with two points are about the origin of its frame, where its force acts on the frame.
        let frame_origin = if two_points { self.frame_origin(n, frame) } else { None };
        let moved = if two_points {
            self.has_two_points = true;
            self.add_moment_point(n, frame, at[1], &named("moments"))?
        } else {
            force_point
        };
        if mass.is_zero() {
            return Ok(n);
        }
        let weighed = |vector| BalanceTerm::force(vector).with_factor(mass.clone());
        self.inertia.forces.push(weighed(acceleration));
        if let Some(gravity) = self.gravity {
            self.weights.push((mass.clone(), force_point[0]));
            self.load.forces.push(weighed(gravity));
        }
        let at_origin = frame_origin.map(|arm| [arm, force_point[1]]);
        for [arm, acceleration] in at_origin.into_iter().chain([moved]) {
            if self.vectors.is_zero(arm) {
                continue;
            }
            self.inertia.moments.push(weighed(acceleration).with_arm(arm));
            if let Some(gravity) = self.gravity {
                self.load.moments.push(weighed(gravity).with_arm(arm));
            }
        }
        Ok(n)
    }

    /// Adds lever arm and acceleration of a point with a mass.
    fn add_mass_point(
        &mut self,
        index: &str,
        frame: FrameIdx,
        at: &[ExactExpression; 3],
        says: &str,
    ) -> Result<[VectorId; 2], DeriveError> {
        let link = self.geometry.tree().link_of(frame).expect("carried by the body");
        let at = self.geometry.vector(at)?;
        let arm = self.geometry.lever_arm(Some(link), &at);
        let acceleration = self.geometry.acceleration(link, &at);
        let arm = self.vectors.add(
            &format!("r_{index}"),
            "m",
            VectorComponents::Known(arm),
            format!("from O to {says}"),
        );
        let acceleration = self.vectors.add(
            &format!("a_{index}"),
            "m/s^2",
            VectorComponents::Known(acceleration),
            format!("acceleration of {says}"),
        );
        self.last_point = Some([arm, acceleration]);
        Ok([arm, acceleration])
    }

    /// Lever arm of the origin of a frame for mass `n`; none if it is the origin of the body.
    fn frame_origin(&mut self, n: usize, frame: FrameIdx) -> Option<VectorId> {
        let link = self.geometry.tree().link_of(frame);
        let arm = self.geometry.lever_arm(link, &vector::ZERO);
        if arm == vector::ZERO {
            return None;
        }
        let says = format!(
            "from O to the origin of frame {}",
            self.geometry.mechanism.frames[frame.0].name
        );
        Some(
            self.vectors
                .add(&format!("r_e{n}"), "m", VectorComponents::Known(arm), says),
        )
    }

    /// Adds the point of mass `n` in the balance of moments: its lever arm from the origin of its frame, and its
    /// acceleration.
    fn add_moment_point(
        &mut self,
        n: usize,
        frame: FrameIdx,
        at: &[ExactExpression; 3],
        says: &str,
    ) -> Result<[VectorId; 2], DeriveError> {
        let link = self.geometry.tree().link_of(frame).expect("carried by the body");
        let at = self.geometry.vector(at)?;
        let arm = self.geometry.express_in_body_axes(&at, Some(link));
        let acceleration = self.geometry.acceleration(link, &at);
        let frame = &self.geometry.mechanism.frames[frame.0].name;
        let from = format!("from the origin of frame {frame} to {says}");
        let arm = self
            .vectors
            .add(&format!("r_d{n}"), "m", VectorComponents::Known(arm), from);
        let meaning = format!("acceleration of {says}");
        let components = VectorComponents::Known(acceleration);
        let acceleration = self.vectors.add(&format!("a_d{n}"), "m/s^2", components, meaning);
        Ok([arm, acceleration])
    }

    /// Adds the moment that an inertia matrix needs.
    fn add_inertia(
        &mut self,
        n: usize,
        link: usize,
        inertia: &[ExactExpression; 6],
        says: &str,
    ) -> Result<(), DeriveError> {
        let mut entries = [Graph::ZERO; 6];
        for (entry, exact) in entries.iter_mut().zip(inertia) {
            *entry = self.geometry.expression(exact)?;
        }
        let moment = self.geometry.gyroscopic_moment(link, entries);
        if self.geometry.moment_axes().iter().all(|k| moment[*k] == Graph::ZERO) {
            return Ok(());
        }
        let matrix = self.vectors.unique_name(&format!("I_c{n}"));
        let [alpha, omega] = self.angular_symbols();
        let symbol = || PrintedFormula::name(matrix.as_str());
        let product = |x: PrintedFormula| PrintedFormula::product(Rational::ONE, [symbol(), x]);
        let shown = PrintedFormula::sum([product(alpha), PrintedFormula::cross(omega.clone(), product(omega))]);
        let meaning = format!("rate of the angular momentum of {says}: {shown}");
        let of_matrix = format!("inertia matrix of {says}, in the axes of its frame: constant there");
        self.matrices.push((matrix, of_matrix));
        let k = self
            .vectors
            .add_moment(&format!("k_c{n}"), VectorComponents::Known(moment), meaning);
        let mut term = BalanceTerm::force(k);
        term.shown = Some(shown);
        self.inertia.moments.push(term);
        Ok(())
    }
}
