//! Descriptions of sizes that no robot has: each is converted or refused in a time that grows with its size only.

use std::fmt::Write as _;

use modelmill_reduction::{ImportOptions, import};

/// A chain of fixed links with one moving link at its end.
fn chain(n: usize) -> String {
    let mut text = "<robot name='r'><link name='l0'/>\n".to_owned();
    for k in 1..=n {
        let kind = if k < n { "fixed" } else { "revolute" };
        _ = write!(
            text,
            "<link name='l{k}'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>\
             </inertial></link>\n<joint name='j{k}' type='{kind}'><parent link='l{}'/><child link='l{k}'/>\
             <axis xyz='0 0 1'/><limit effort='1' velocity='1'/></joint>\n",
            k - 1
        );
    }
    text + "</robot>"
}

#[test]
fn a_long_chain_of_fixed_links_is_converted() {
    let start = std::time::Instant::now();
    let imported = import(&chain(15_000), &ImportOptions::default()).unwrap();
    assert_eq!(imported.joints.len(), 1);
    // The square of the number took more than a minute.
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn deep_bodies_and_elements_of_many_attributes_are_refused_with_their_place() {
    let body = "<body><joint/><geom size='0.1'/>\n";
    let deep = format!(
        "<mujoco><worldbody>\n{}{}</worldbody></mujoco>",
        body.repeat(2500),
        "</body>".repeat(2500)
    );
    let fault = import(&deep, &ImportOptions::default()).unwrap_err().to_string();
    assert!(
        fault.contains("line 200") && fault.contains("nested more than 200 levels deep"),
        "{fault}"
    );
    let attributes = (0..200_000).fold(String::new(), |text, k| text + &format!(" x{k}='1'"));
    let wide = format!("<robot name='r'>\n<link name='a'{attributes}/></robot>");
    let fault = import(&wide, &ImportOptions::default()).unwrap_err().to_string();
    assert!(fault.contains("line 2") && fault.contains("attributes"), "{fault}");
}
