//! Joints of descriptions that follow others by any ratio, and screws.

use modelmill_boundary::files::DiskFiles;
use modelmill_reduction::{ImportOptions, import};
use modelmill_spec::Mechanism;

const BODY: &str = "<inertial><mass value='1'/><origin xyz='0.1 0 0'/>\
    <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial>";

fn imported(text: &str) -> (String, Mechanism) {
    let found = import(text, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let loaded = modelmill_spec::load("robot.toml", &found.model, &DiskFiles::default())
        .unwrap_or_else(|failure| panic!("{failure}\n{}", found.model));
    (found.model, loaded.mechanism)
}

/// A coordinate by what it follows: its name, factor and offset.
#[track_caller]
fn check(mechanism: &Mechanism, name: &str, of: &str, factor: f64, offset: f64) {
    let i = mechanism.coordinates.iter().position(|c| c.name == name);
    let i = i.unwrap_or_else(|| panic!("no coordinate {name}"));
    let coupling = mechanism.couplings.iter().find(|c| c.coordinate.0 == i);
    let coupling = coupling.unwrap_or_else(|| panic!("{name} follows nothing"));
    let value = |symbol| mechanism.symbol_nominal(symbol);
    let [(followed, found)] = &coupling.terms[..] else {
        panic!("{name} follows several");
    };
    assert_eq!(mechanism.coordinates[followed.0].name, of);
    assert!((found.evaluate(&value) - factor).abs() < 1e-12, "{name}");
    let found = coupling.offset.evaluate(&value);
    assert!((found - offset).abs() < 1e-12, "{name}: {found}");
}

#[test]
fn joints_mimic_by_any_ratio() {
    let limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/><axis xyz='0 1 0'/>";
    let urdf = format!(
        "<robot name='mimics'><link name='foot'/><link name='a'>{BODY}</link><link name='b'>{BODY}</link><link name='c'>{BODY}</link>\
         <joint name='lead' type='revolute'><parent link='foot'/><child link='a'/>{limit}</joint>\
         <joint name='real' type='revolute'><parent link='a'/><child link='b'/>{limit}\
         <mimic joint='lead' multiplier='-0.731' offset='0.2'/></joint>\
         <joint name='rack' type='prismatic'><parent link='a'/><child link='c'/>{limit}\
         <mimic joint='lead' multiplier='0.02'/></joint></robot>"
    );
    let (text, mechanism) = imported(&urdf);
    check(&mechanism, "real", "lead", -0.731, 0.2);
    check(&mechanism, "rack", "lead", 0.02, 0.0);
    assert_eq!(mechanism.drives.len(), 1, "{text}");
}

#[test]
fn a_screw_of_sdf_turns_and_slides() {
    let sdf = |pitch: &str| {
        format!(
            "<sdf version='1.10'><model name='vice'><link name='frame'/><link name='jaw'><inertial><mass>2</mass></inertial></link>\
             <joint name='fixed' type='fixed'><parent>world</parent><child>frame</child></joint>\
             <joint name='spindle' type='screw'><parent>frame</parent><child>jaw</child><axis><xyz>1 0 0</xyz></axis>{pitch}</joint>\
             </model></sdf>"
        )
    };
    let (_, mechanism) = imported(&sdf("<screw_thread_pitch>0.005</screw_thread_pitch>"));
    let h = 0.005 / std::f64::consts::TAU;
    check(&mechanism, "spindle_2", "spindle", h, 0.0);
    let refused = import(&sdf(""), &ImportOptions::default()).expect_err("no pitch");
    assert!(refused.to_string().contains("screw_thread_pitch"), "{refused}");
}

/// A gearbox couples the angles of parent and child against its reference body: theta_2 = -ratio theta_1. The tree has the
/// hinge of the second wheel from wheel to housing, and its axis points the other way.
#[test]
fn a_gearbox_of_sdf_couples_two_hinges() {
    let body = "<inertial><mass>2</mass></inertial>";
    let sdf = |axis2: &str, reference: &str| {
        format!(
            "<sdf version='1.10'><model name='gears'><link name='housing'/><link name='one'>{body}</link><link name='two'>{body}</link>\
             <joint name='fixed' type='fixed'><parent>world</parent><child>housing</child></joint>\
             <joint name='first' type='revolute'><parent>housing</parent><child>one</child><axis><xyz>0 0 1</xyz></axis></joint>\
             <joint name='second' type='revolute'><parent>two</parent><child>housing</child><axis><xyz>0 0 -1</xyz>\
             <limit><effort>0</effort></limit></axis></joint>\
             <joint name='box' type='gearbox'><parent>one</parent><child>two</child><axis><xyz>0 0 1</xyz></axis>\
             <axis2><xyz>{axis2}</xyz></axis2><gearbox_ratio>2.5</gearbox_ratio>\
             <gearbox_reference_body>{reference}</gearbox_reference_body></joint></model></sdf>"
        )
    };
    // The second hinge turns by the angle of the housing against the wheel about -z, which is that of the wheel about z.
    let (text, mechanism) = imported(&sdf("0 0 1", "housing"));
    check(&mechanism, "second", "first", -2.5, 0.0);
    assert_eq!(mechanism.drives.len(), 1, "{text}");
    let (_, mechanism) = imported(&sdf("0 0 -1", "housing"));
    check(&mechanism, "second", "first", 2.5, 0.0);
    for (axis, reference, reason) in [
        ("0 1 0", "housing", "not that of the joint"),
        ("0 0 1", "two", "has no revolute joint"),
    ] {
        let refused = import(&sdf(axis, reference), &ImportOptions::default()).expect_err(reason);
        assert!(refused.to_string().contains(reason), "{refused}");
    }
}
