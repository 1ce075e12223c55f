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

/// The links `l0` to `l<n>` with what `between` writes for each, inside an element `around`.
fn repeated(around: [&str; 2], n: usize, between: impl Fn(usize) -> String) -> String {
    let inside = (0..n).map(between).collect::<Vec<_>>();
    [around[0], &inside.concat(), around[1]].concat()
}

/// The text and seconds of a refusal.
fn refusal(text: &str) -> (String, f64) {
    let start = std::time::Instant::now();
    let fault = import(text, &ImportOptions::default()).unwrap_err().to_string();
    (fault, start.elapsed().as_secs_f64())
}

#[test]
fn descriptions_of_many_joints_links_and_names_are_refused_in_time() {
    const N: usize = 6000;
    let urdf = ["<robot name='r'><link name='l'/>", "</robot>"];
    let mjcf = ["<mujoco><worldbody><body name='b'>", "</body></worldbody></mujoco>"];
    let sdf = ["<sdf version='1.7'><model name='m'>", "</model></sdf>"];
    let star = repeated(urdf, N, |k| {
        format!(
            "\n<link name='l{k}'/><joint name='j{k}' type='revolute'><parent link='l'/><child link='l{k}'/>\
             <axis xyz='0 0 1'/><limit effort='1' velocity='1'/></joint>"
        )
    });
    let slides = repeated(mjcf, 4 * N, |k| format!("\n<joint name='j{k}' type='slide'/>"));
    let same = repeated(mjcf, N, |_| "\n<joint name='j'/>".to_owned());
    let loose = repeated(sdf, 4 * N, |k| format!("\n<link name='l{k}'/>"));
    let chain = repeated(sdf, N, |k| {
        format!(
            "\n<link name='l{k}'/><joint name='j{k}' type='revolute'><parent>{}</parent><child>l{k}</child>\
             <axis><xyz>0 0 1</xyz></axis></joint>",
            if k == 0 {
                "world".to_owned()
            } else {
                format!("l{}", k - 1)
            }
        )
    });
    for text in [star, slides, same, loose, chain] {
        let (fault, seconds) = refusal(&text);
        assert!(
            fault.contains("line ") && fault.contains("more than 1000 joints"),
            "{fault}"
        );
        // The square of the number took minutes.
        assert!(seconds < 4.0, "{fault}: {seconds} s");
    }
    let sites = repeated(mjcf, N, |k| format!("\n<site name='s{k}'/>"));
    let motors = repeated(["<mujoco><actuator>", "</actuator></mujoco>"], N, |k| {
        format!("\n<motor name='m{k}' joint='j'/>")
    });
    for (text, what) in [(sites, "elements of this kind"), (motors, "elements in <actuator>")] {
        let (fault, _) = refusal(&text);
        assert!(fault.contains("line 5002") && fault.contains(what), "{fault}");
    }
}

#[test]
fn a_long_chain_of_fixed_links_in_sdf_is_converted() {
    let fixed = |k: usize| {
        format!(
            "<link name='l{k}'/><joint name='j{k}' type='{}'><parent>{}</parent><child>l{k}</child>\
             <axis><xyz>0 0 1</xyz></axis></joint>\n",
            if k == 0 { "revolute" } else { "fixed" },
            if k == 0 {
                "world".to_owned()
            } else {
                format!("l{}", k - 1)
            }
        )
    };
    let text = repeated(["<sdf version='1.7'><model name='m'>", "</model></sdf>"], 5000, fixed);
    let start = std::time::Instant::now();
    let imported = import(&text, &ImportOptions::default()).unwrap();
    assert_eq!(imported.joints.len(), 1);
    assert!(start.elapsed().as_secs() < 4, "{:?}", start.elapsed());
}

#[test]
fn attributes_of_large_default_classes_are_looked_up_in_time() {
    const N: usize = 10_000;
    let text = format!(
        "<mujoco><default><default class='c'>{}</default></default><worldbody><body><joint/>{}</body></worldbody></mujoco>",
        "<geom mass='2'/>".repeat(N),
        "<geom class='c' size='0.1'/>".repeat(N)
    );
    let start = std::time::Instant::now();
    let imported = import(&text, &ImportOptions::default()).unwrap();
    // The square of the number took half a minute.
    assert!(start.elapsed().as_secs() < 4, "{:?}", start.elapsed());
    assert!(imported.model.contains("20000"), "{}", imported.model);
}

/// A mesh is integrated once for all shapes that are made of it, and found by its name without a search. The mass is that of
/// triangles of 0.5 m^2 with 1000 kg/m^2.
#[test]
fn many_shapes_of_meshes_are_computed_in_time() {
    const N: usize = 15_000;
    let triangle = "vertex='0 0 0 1 0 0 0 1 0' face='";
    let large = format!(
        "<mesh name='large' inertia='shell' {triangle}{}'/>",
        "0 1 2 ".repeat(4 * N)
    );
    let small = (0..N).fold(String::new(), |text, k| {
        text + &format!("<mesh name='m{k}' inertia='shell' {triangle}0 1 2'/>")
    });
    let shapes = (0..N).fold(String::new(), |text, k| {
        text + &format!("<geom type='mesh' mesh='large' mass='1'/><geom type='mesh' mesh='m{k}'/>")
    });
    let text = format!(
        "<mujoco><asset>{large}{small}</asset><worldbody><body><joint name='j'/>{shapes}</body></worldbody>\
         <actuator><motor joint='j'/></actuator></mujoco>"
    );
    let start = std::time::Instant::now();
    let imported = import(&text, &ImportOptions::default()).unwrap();
    // The square of the number took minutes.
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    let mass = N as f64 * (1.0 + 500.0);
    assert!(
        imported.model.contains(&format!("{mass}")),
        "{mass}: {}",
        imported.model
    );
}

/// Mutated files led here: a system of equations without a row ended the program.
#[test]
fn closures_and_joints_of_one_link_are_refused() {
    let bodies = "<mujoco><worldbody><body name='a'><joint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/></body>\
                  </worldbody><equality>";
    for equality in [
        "<connect name='c' body1='a' body2='a' anchor='0.1 0 0'/>",
        "<weld name='c' body1='a' body2='a'/>",
    ] {
        let (fault, _) = refusal(&format!("{bodies}{equality}</equality></mujoco>"));
        assert!(
            fault.contains("line 1") && fault.contains("`c` connects a link with itself"),
            "{fault}"
        );
    }
    let (fault, _) = refusal(
        "<sdf version='1.7'><model name='m'><link name='a'/><joint name='j' type='revolute'><parent>a</parent>\
         <child>a</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>",
    );
    assert!(
        fault.contains("<joint> `j`") && fault.contains("the same link"),
        "{fault}"
    );
}
