//! Whether the sizes of bodies fit the mechanism: a rig goes in, a remark about units comes out.
//!
//! The radius of gyration is the root of inertia over mass. If masses are in grams and inertias in kg m^2, it is too small
//! by a factor of 32; if lengths are in millimetres, it does not fit the distances of joints.

use modelmill_spec::{Diagnostic, DiagnosticSeverity};
use nalgebra::Vector3;

use crate::load::plain_error;
use crate::rig::Rig;

/// The largest radius of gyration of a machine's bodies, as shares of the largest distance of its joints (1). The bundled
/// rigs have 0.13 to 0.5. A factor of 32 or 1000 leaves this range. By judgement.
const GYRATION_SHARES: std::ops::RangeInclusive<f64> = 0.01..=3.0;

/// A remark if the bodies are too large or too small for the distances of the joints.
pub(crate) fn size_remark(rig: &Rig) -> Option<Diagnostic> {
    let (body, radius) = largest_radius(rig)?;
    let length = joint_distance(rig)?;
    if GYRATION_SHARES.contains(&(radius / length)) {
        return None;
    }
    let size = if radius > length { "large" } else { "small" };
    Some(Diagnostic {
        severity: DiagnosticSeverity::Warning,
        help: vec![
            "check the units: mass in kg, lengths in m, inertia in kg m^2; a mass in g gives a radius that is too small by \
             a factor of 32"
                .into(),
        ],
        ..plain_error(
            None,
            format!(
                "the bodies are {size} for this mechanism: the largest radius of gyration is {radius:.2e} m (`{body}`), \
                 and its joints are up to {length:.2e} m apart"
            ),
        )
    })
}

/// The body with the largest radius of gyration, m.
fn largest_radius(rig: &Rig) -> Option<(&str, f64)> {
    let bodies = rig.bodies.iter().filter(|body| body.mass > 0.0);
    let radii = bodies.map(|body| {
        let moment = body.inertia.symmetric_eigenvalues().max();
        (body.name.as_str(), (moment.max(0.0) / body.mass).sqrt())
    });
    radii
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(_, radius)| *radius > 0.0)
}

/// The largest distance of two joints in the nominal configuration, m.
fn joint_distance(rig: &Rig) -> Option<f64> {
    let places: Vec<Vector3<f64>> = (0..rig.joints.len())
        .filter_map(|joint| rig.hinge(joint))
        .map(|[anchor, _]| match anchor.body {
            None => anchor.at,
            Some(body) => {
                let pose = rig.bodies[body].nominal;
                pose.q_WB * anchor.at + pose.p_WB_W
            }
        })
        .collect();
    let distances = places.iter().flat_map(|a| places.iter().map(move |b| (a - b).norm()));
    distances.max_by(f64::total_cmp).filter(|length| *length > 0.0)
}

#[cfg(test)]
mod tests {
    use modelmill_boundary::files::MemoryFiles;

    /// A chain of two links, with masses and lengths in other units.
    fn remarks(mass: f64, length: f64, inertia: f64) -> usize {
        let text = format!(
            "schema = 1\nname = \"chain\"\nbody = [\n{{ name = \"a\", mass = {mass}, centre = [{c}, 0, 0], inertia = {{ zz = \
             {inertia} }} }},\n{{ name = \"b\", mass = {mass}, centre = [{d}, 0, 0], inertia = {{ zz = {inertia} }} }}]\njoint = \
             [\n{{ name = \"one\", kind = \"revolute\", between = [\"base\", \"a\"], at = [0, 0, 0] }},\n{{ name = \"two\", kind = \
             \"revolute\", between = [\"a\", \"b\"], at = [{length}, 0, 0] }}]\ncoordinate = [{{ name = \"p\", joint = \"one\" \
             }}, {{ name = \"q\", joint = \"two\" }}]\ndrive = [{{ name = \"m1\", joint = \"one\" }}, {{ name = \"m2\", joint = \
             \"two\" }}]\n",
            c = 0.5 * length,
            d = 1.5 * length
        );
        let loaded = crate::load("chain.toml", &text, &MemoryFiles::default());
        loaded.unwrap_or_else(|failure| panic!("{failure}")).remarks.len()
    }

    #[test]
    fn wrong_units_are_remarked() {
        // Slender links of 0.1 to 2 m: m l^2 / 12.
        for length in [0.1_f64, 0.5, 2.0] {
            let (mass, inertia) = (3.0 * length, 3.0 * length.powi(3) / 12.0);
            assert_eq!(remarks(mass, length, inertia), 0);
            // Lengths in mm, inertia in g mm^2 or kg mm^2.
            assert_eq!(remarks(mass, 1e3 * length, inertia), 1);
            assert_eq!(remarks(mass, length, 1e9 * inertia), 1);
            assert_eq!(remarks(mass, length, 1e6 * inertia), 1);
            // Masses in g.
            assert_eq!(remarks(1e3 * mass, length, inertia), 1);
        }
    }
}
