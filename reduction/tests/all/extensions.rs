//! Closures and rotors that descriptions state by extensions of their format. What is read is compared with mechanics
//! written down here; what is not read is named.

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates, derive};
use modelmill_reduction::{DescriptionImport, ImportOptions, import};

use crate::lines;

const GRAVITY: f64 = 9.81;

pub(crate) fn imported(text: &str) -> DescriptionImport {
    import(text, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

pub(crate) fn derived(imported: &DescriptionImport) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", &imported.model, &MemoryFiles::default());
    derive(&loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism).expect("a derivation")
}

/// Value of the first independent coordinate, and the force of the first drive there. Other coordinates stay nominal.
pub(crate) fn force(derivation: &Derivation, [offset, rate, acceleration]: [f64; 3]) -> (f64, f64) {
    let coordinates = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
    let mut q: Vec<f64> = coordinates.map(|c| c.nominal).collect();
    q[0] += offset;
    let mut motion = [rate, acceleration].map(|first| vec![first; 1]);
    for column in &mut motion {
        column.resize(q.len(), 0.0);
    }
    let one = |column: &'_ [f64]| column.iter().map(|x| vec![*x]).collect::<Vec<_>>();
    let columns = [one(&q), one(&motion[0]), one(&motion[1])];
    let slices = |k: usize| columns[k].iter().map(Vec::as_slice).collect();
    let states = MotionStates {
        q: slices(0),
        qd: slices(1),
        qdd: slices(2),
        load: Vec::new(),
    };
    let forces = ModelEvaluator::new(derivation).inverse_dynamics(&states, &derivation.nominal_base_values());
    (q[0], forces.expect("forces")[0][0])
}

fn urdf_link(name: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="1.0"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>"#
    )
}

fn urdf_joint(name: &str, [parent, child]: [&str; 2], x: f64) -> String {
    format!(
        r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="5"/></joint>"#
    )
}

/// A four-bar linkage of which the URDF has three joints; `closure` closes it.
fn four_bar(closure: &str) -> String {
    let links: String = ["base", "crank", "coupler", "rocker"].map(urdf_link).concat();
    let joints = urdf_joint("j1", ["base", "crank"], 0.0)
        + &urdf_joint("j2", ["crank", "coupler"], 0.2)
        + &urdf_joint("j3", ["base", "rocker"], 0.5);
    format!(r#"<robot xmlns:drake="https://drake.mit.edu" name="four_bar">{links}{joints}{closure}</robot>"#)
}

/// Potential energies of the four-bar linkage at an angle of the crank, for both ways to assemble it. Lengths 0.2, 0.5
/// and 0.3, the ground 0.5; each link has 1 kg at 0.1 from its joint.
fn four_bar_energies(crank: f64) -> [f64; 2] {
    // In the plane of x and z; a positive angle about y turns x downwards.
    let p = [0.2 * crank.cos(), -0.2 * crank.sin()];
    let ground = [0.5, 0.0];
    let d = [ground[0] - p[0], ground[1] - p[1]];
    let distance = d[0].hypot(d[1]);
    let along = (0.25 - 0.09 + distance * distance) / (2.0 * distance);
    let across = (0.25 - along * along).sqrt();
    [1.0, -1.0].map(|sign| {
        let height = p[1] + along * d[1] / distance + sign * across * d[0] / distance;
        let coupler = p[1] + 0.1 / 0.5 * (height - p[1]);
        let rocker = 0.1 / 0.3 * height;
        GRAVITY * (0.5 * p[1] + coupler + rocker)
    })
}

#[test]
fn closures_of_a_urdf_are_read() {
    let revolute = r#"<constraint name="cut" type="revolute"><parent link="coupler"/><parent_origin xyz="0.5 0 0"/>
        <parent_axis xyz="0 1 0"/><child link="rocker"/><child_origin xyz="0.3 0 0"/><child_axis xyz="0 1 0"/></constraint>"#;
    let ball = r#"<drake:ball_constraint><drake:ball_constraint_body_A name="coupler"/>
        <drake:ball_constraint_body_B name="rocker"/><drake:ball_constraint_p_AP value="0.5 0 0"/>
        <drake:ball_constraint_p_BQ value="0.3 0 0"/></drake:ball_constraint>"#;
    for closure in [
        revolute,
        ball,
        &revolute.replace(r#"type="revolute""#, r#"type="spherical""#),
    ] {
        let imported = imported(&four_bar(closure));
        let remarks = lines(&imported.remarks);
        assert!(!remarks.contains("not read"), "{remarks}");
        let derivation = derived(&imported);
        let active = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
        let active: Vec<&str> = active.map(|c| c.name.as_str()).collect();
        assert_eq!(active, ["j1"], "{closure}");
        // The force at standstill is the derivative of the potential energy, in one of both assemblies.
        for offset in [-0.1, 0.0, 0.07] {
            let (crank, force) = force(&derivation, [offset, 0.0, 0.0]);
            let h = 1e-5;
            let [up, down] = [crank + h, crank - h].map(four_bar_energies);
            let errors = [0, 1].map(|k| ((up[k] - down[k]) / (2.0 * h) - force).abs());
            assert!(errors[0].min(errors[1]) < 1e-7, "{crank}: {force}, {errors:?}");
        }
    }
    let fault = import(
        &four_bar(&revolute.replace("revolute", "prismatic")),
        &ImportOptions::default(),
    );
    assert!(fault.unwrap_err().to_string().contains("ball, revolute and fixed"));
}

/// A parallelogram of SDF: two rockers of length 2 and a beam in two halves, which `closure` joins in its middle.
fn parallelogram(closure: &str) -> String {
    let link = |name: &str, pose: &str, centre: &str, mass: f64| {
        format!(
            "<link name=\"{name}\"><pose>{pose}</pose><inertial><pose>{centre} 0 0 0</pose><mass>{mass}</mass>\
             <inertia><ixx>0.3</ixx><iyy>0.3</iyy><izz>0.3</izz></inertia></inertial></link>"
        )
    };
    let joint = |name: &str, [parent, child]: [&str; 2], pose: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><pose relative_to=\"{parent}\">{pose}</pose><parent>{parent}</parent>\
             <child>{child}</child><axis><xyz>0 1 0</xyz></axis></joint>"
        )
    };
    let links = link("D", "0 0 0 0 0 0", "0 0 1", 1.0)
        + &link("C", "0 0 2 0 0 0", "1.5 0 0", 0.5)
        + &link("S", "0 0 2 0 0 0", "1.5 0 0", 0.5)
        + &link("R", "3 0 0 0 0 0", "0 0 1", 1.0);
    let joints = joint("WD", ["world", "D"], "0 0 0 0 0 0")
        + &joint("DC", ["D", "C"], "0 0 2 0 0 0")
        + &joint("WR", ["world", "R"], "3 0 0 0 0 0")
        + &joint("RS", ["R", "S"], "0 0 2 0 0 0");
    format!(
        "<sdf version=\"1.9\" xmlns:drake=\"https://drake.mit.edu\"><model name=\"p\">{links}{joints}\
         <frame name=\"Ccm\" attached_to=\"C\"><pose>1.5 0 0 0 0 0</pose></frame>\
         <frame name=\"Scm\" attached_to=\"S\"><pose>1.5 0 0 0 0 0</pose></frame>{closure}</model></sdf>"
    )
}

#[test]
fn a_weld_of_two_frames_of_an_sdf_is_read() {
    let weld = "<drake:weld_constraint><parent>Ccm</parent><child>Scm</child></drake:weld_constraint>";
    let imported = imported(&parallelogram(weld));
    let derivation = derived(&imported);
    let active = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
    assert_eq!(active.count(), 1, "{}", imported.model);
    for offset in [0.1, -0.3] {
        // Rockers with 1 kg at 1 m each, and 1 kg of the beam at 2 m.
        let (_, force) = force(&derivation, [offset, 0.0, 0.0]);
        let expected = 4.0 * GRAVITY * offset.sin();
        assert!((force.abs() - expected.abs()).abs() < 1e-9, "{force} {expected}");
    }
}

#[test]
fn rotors_of_transmissions_and_damping_of_actuators_are_read() {
    let robot = |actuator: &str| {
        format!(
            r#"<robot xmlns:drake="https://drake.mit.edu" name="rotor">{}{}{}<transmission name="t1">
            <type>transmission_interface/SimpleTransmission</type><joint name="j1"/>
            <actuator name="m1">{actuator}</actuator></transmission></robot>"#,
            urdf_link("base"),
            urdf_link("arm"),
            urdf_joint("j1", ["base", "arm"], 0.0)
        )
    };
    // Of a change of the acceleration by 2 rad/s^2.
    let inertia = |text: &str| {
        let derivation = derived(&imported(text));
        let [at, without] = [2.0, 0.0].map(|qdd| force(&derivation, [0.3, 0.0, qdd]).1);
        (at - without) / 2.0
    };
    let own = 0.02 + 0.1 * 0.1;
    assert!((inertia(&robot("")) - own).abs() < 1e-12);
    let rotor = r#"<drake:rotor_inertia value="1e-4"/>"#;
    assert!((inertia(&robot(rotor)) - own - 1e-4).abs() < 1e-12);
    let geared = format!(r#"{rotor}<drake:gear_ratio value="100"/>"#);
    assert!((inertia(&robot(&geared)) - own - 1.0).abs() < 1e-12);
    // MuJoCo reflects damping and armature of an actuator by the square of its gear; defaults count.
    let arm = |default: &str, actuator: &str| {
        format!(
            r#"<mujoco>{default}<worldbody><body name="a"><joint name="j1" axis="0 1 0" damping="0.2"/>
            <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.02"/></body></worldbody>
            <actuator><motor joint="j1" gear="30" {actuator}/></actuator></mujoco>"#
        )
    };
    let by_class = r#"<default><motor damping="0.001"/></default>"#;
    for text in [arm("", r#"damping="0.001""#), arm(by_class, "")] {
        let derivation = derived(&imported(&text));
        let [at, without] = [1.5, 0.0].map(|qd| force(&derivation, [0.3, qd, 0.0]).1);
        assert!(((at - without) / 1.5 - 0.2 - 0.9).abs() < 1e-12, "{text}");
    }
}

/// In each element of a description, an attribute and an element that no format has are named.
#[test]
fn what_is_not_read_is_named() {
    let urdf =
        four_bar("<transmission name=\"t\"><type>x</type><joint name=\"j1\"/><actuator name=\"m\"/></transmission>");
    let sdf = parallelogram("");
    let mjcf = r#"<mujoco><compiler angle="radian"/><option timestep="0.1"><flag contact="disable"/></option>
        <default><joint damping="1"/></default><worldbody><body name="a"><joint name="j1" axis="0 1 0"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.02"/><geom type="sphere" size="0.1"/>
        <frame pos="1 0 0"><body name="b"><joint name="j2"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></frame>
        </body></worldbody><tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>
        <equality><joint joint1="j1" joint2="j2"/></equality><actuator><motor joint="j1"/></actuator></mujoco>"#;
    for text in [urdf.as_str(), sdf.as_str(), mjcf] {
        let plain = lines(&imported(text).remarks);
        assert!(!plain.contains("not read"), "{plain}");
        let document = roxmltree::Document::parse(text).expect("XML");
        for node in document.root().descendants().filter(roxmltree::Node::is_element) {
            let start = node.range().start;
            let name_end = start + 1 + text[start + 1..].find([' ', '>', '/']).expect("a tag ends");
            let tag = node.tag_name().name();
            let with_attribute = format!("{} unheard=\"1\"{}", &text[..name_end], &text[name_end..]);
            let remarks = lines(&imported(&with_attribute).remarks);
            assert!(remarks.contains(&format!("`unheard` of <{tag}>")), "{tag}: {remarks}");
            // Elements with text only are read as text.
            if node.has_children() && node.children().any(|child| child.is_element()) {
                let open_end = start + text[start..].find('>').expect("a tag ends") + 1;
                let with_element = format!("{}<unheard mass=\"1\"/>{}", &text[..open_end], &text[open_end..]);
                // An equality of an unknown kind is refused.
                let named = match import(&with_element, &ImportOptions::default()) {
                    Ok(imported) => lines(&imported.remarks),
                    Err(error) => error.to_string(),
                };
                assert!(named.contains("unheard"), "{tag}: {named}");
            }
        }
    }
    // Extensions with a closure or a spring that is not read.
    let gazebo = "<gazebo><joint name=\"cut\" type=\"revolute\"/></gazebo><gazebo reference=\"j1\">\
                  <springStiffness>5</springStiffness><material>Red</material></gazebo>";
    let remarks = lines(&imported(&four_bar(gazebo)).remarks);
    assert!(
        remarks.contains("<joint> in <gazebo>") && remarks.contains("<springStiffness>"),
        "{remarks}"
    );
    assert!(!remarks.contains("material"), "{remarks}");
}
