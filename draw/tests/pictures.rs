//! Every bundled model has a picture: well formed, within its sheet, with lengths that are those of the model.

use std::path::{Path, PathBuf};

use modelmill_draw::{DrawingStyle, MarkShape, MechanismScene, svg};
use modelmill_spec::Mechanism;

fn bundled() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    let entries = std::fs::read_dir(folder).expect("bundled models");
    let mut files: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    assert!(files.len() > 20);
    files
}

fn load(name: &str) -> Mechanism {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../model-spec/models/{name}.toml"));
    modelmill_spec::load_file(&file).expect("a bundled model").mechanism
}

fn nominal(mechanism: &Mechanism) -> MechanismScene {
    let q: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    MechanismScene::new(mechanism, &q)
}

#[test]
fn every_bundled_model_is_drawn_within_its_sheet() {
    for file in bundled() {
        let mechanism = modelmill_spec::load_file(&file).expect("a bundled model").mechanism;
        let scene = nominal(&mechanism);
        let style = DrawingStyle {
            frames: true,
            ..DrawingStyle::default()
        };
        let text = svg(&[&scene], &scene.best_view(), &style);
        let document = roxmltree::Document::parse(&text).expect("well-formed SVG");
        let joints = scene
            .marks
            .iter()
            .filter(|m| matches!(m.shape, MarkShape::Joint(_)))
            .count();
        let drawn = document.descendants().filter(|node| {
            let class = node.attribute("class").unwrap_or_default();
            class.starts_with("joint") && !class.contains("cap") && node.tag_name().name() != "text"
        });
        assert_eq!(drawn.count(), joints, "{}", mechanism.name);
        for node in document.descendants() {
            for (attribute, most) in [("cx", 640.0), ("cy", 480.0), ("x", 640.0), ("y", 480.0)] {
                let Some(value) = node.attribute(attribute) else {
                    continue;
                };
                let value: f64 = value.parse().expect("a number");
                assert!(
                    (0.0..=most).contains(&value),
                    "{}: {attribute} = {value}",
                    mechanism.name
                );
            }
        }
    }
}

/// Which models move in a plane is known.
#[test]
fn planar_mechanisms_are_seen_flat() {
    let planar: Vec<String> = (bundled().iter())
        .map(|file| modelmill_spec::load_file(file).expect("a bundled model").mechanism)
        .filter(|mechanism| nominal(mechanism).plane.is_some())
        .map(|mechanism| mechanism.name)
        .collect();
    let expected = [
        "emps_directional",
        "emps",
        "five_bar",
        "four_bar",
        "parallelogram",
        "slider_crank",
        "spidermill_paper",
        "spidermill",
        "three_rpr",
        "three_rrr",
        "two_link",
    ];
    assert_eq!(planar, expected);
}

/// The cranks and couplers of the bundled robot are as long in the picture as its constants say, on one scale.
#[test]
fn lengths_are_those_of_the_model() {
    let mechanism = load("spidermill");
    let scene = nominal(&mechanism);
    let view = scene.best_view();
    let length = |name: &str| {
        let longest = scene
            .marks
            .iter()
            .filter(|m| m.description == name)
            .filter_map(|m| match &m.shape {
                MarkShape::Bar([a, b]) | MarkShape::Arm([a, b]) => {
                    let [a, b] = [a, b].map(|at| view.project(at));
                    Some((a[0] - b[0]).hypot(a[1] - b[1]))
                }
                _ => None,
            });
        longest.fold(0.0, f64::max)
    };
    let constant = |name: &str| {
        let mut constants = mechanism.constants.iter();
        constants.find(|c| c.name == name).expect("a constant").value
    };
    for (bodies, expected) in [(["S1", "S7"], constant("d1")), (["S3", "S5"], constant("d3"))] {
        for body in bodies {
            assert!((length(body) - expected).abs() < 1e-9, "{body}: {}", length(body));
        }
    }
    // Gravity points down in the picture.
    let down = view.project(&scene.down.expect("gravity"));
    assert!(down[0].abs() < 1e-12 && (down[1] + 1.0).abs() < 1e-12, "{down:?}");
}

/// A loop that is open is seen open, and a variant lies over what it was.
#[test]
fn what_is_wrong_is_seen() {
    let mechanism = load("four_bar");
    let mut q: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    let closings = |scene: &MechanismScene| {
        scene
            .marks
            .iter()
            .filter(|m| matches!(m.shape, MarkShape::Closing(_)))
            .count()
    };
    let closed = MechanismScene::new(&mechanism, &q);
    let passive = mechanism
        .coordinates
        .iter()
        .position(|c| c.passive)
        .expect("a passive one");
    q[passive] += 0.2;
    let open = MechanismScene::new(&mechanism, &q);
    assert_eq!(closings(&open), closings(&closed) + 1);
    let text = svg(&[&closed, &open], &closed.best_view(), &DrawingStyle::default());
    assert_eq!(text.matches("class=\"shadow\"").count(), 1);
}

/// A force is seen at its drive, pointing where it pushes, and longer where it is larger.
#[test]
fn forces_are_arrows_at_their_drives() {
    let scene = nominal(&load("spidermill"));
    let length = |force: f64| {
        let load = modelmill_draw::DriveArrow {
            drive: "spindle_left".to_owned(),
            force,
            error: 1.0,
        };
        let text = modelmill_draw::loaded_svg(&[&scene], &scene.best_view(), &DrawingStyle::default(), &[load]);
        let group = text.split("<g class=\"load e5\">").nth(1).expect("arrows");
        let d = group.split("d=\"M").nth(1).expect("a path");
        let numbers: Vec<f64> = d
            .split('"')
            .next()
            .expect("a path")
            .split(['L', ' '])
            .map(|n| n.parse().expect("a number"))
            .collect();
        (numbers[2] - numbers[0]).hypot(numbers[3] - numbers[1])
    };
    assert!((length(1.0) - 2.0 * length(0.5)).abs() < 0.3);
    assert!((length(-1.0) - length(1.0)).abs() < 0.3);
}

/// An error of a few percent does not have the colour of no error, and a larger error never a better colour.
#[test]
fn errors_of_a_few_percent_have_colours_of_their_own() {
    let scene = nominal(&load("spidermill"));
    let colour = |error: f64| {
        let load = modelmill_draw::DriveArrow {
            drive: "spindle_left".to_owned(),
            force: 1.0,
            error,
        };
        let text = modelmill_draw::loaded_svg(&[&scene], &scene.best_view(), &DrawingStyle::default(), &[load]);
        let class = text.split("<g class=\"load e").nth(1).expect("arrows");
        class
            .split('"')
            .next()
            .and_then(|e| e.parse::<u32>().ok())
            .expect("a shade")
    };
    let colours = [0.0, 0.005, 0.015, 0.03, 0.07, 0.15, 0.5, f64::NAN].map(colour);
    assert_eq!(colours, [0, 0, 1, 2, 3, 4, 5, 5]);
}

/// Places of the joints of a scene, by the start of their names.
fn joint_places(scene: &MechanismScene, name: &str) -> Vec<nalgebra::Vector3<f64>> {
    let joints = scene.marks.iter().filter(|mark| mark.name == name);
    let places = joints.filter_map(|mark| match &mark.shape {
        MarkShape::Joint(joint) => Some(joint.at),
        _ => None,
    });
    places.collect()
}

/// The block of a slider-crank is at its pin, where the rod ends, and not at the zero of its coordinate.
#[test]
fn a_slide_on_the_base_is_drawn_where_it_has_moved() {
    let scene = nominal(&load("slider_crank"));
    let pin = scene.marks.iter().find_map(|mark| match &mark.shape {
        MarkShape::Closing(at) => Some(*at),
        _ => None,
    });
    let block = joint_places(&scene, "slide");
    assert_eq!(block.len(), 1);
    let distance = (block[0] - pin.expect("a closed loop")).norm();
    assert!(distance < 1e-4, "{distance} m");
}

/// Coordinates of a platform are not joints: only the joints of the legs are drawn. Joints that a machine has stay.
#[test]
fn virtual_chains_are_not_drawn() {
    for (name, coordinates) in [
        ("three_rpr", &["x", "y", "phi"][..]),
        ("delta", &["x", "y", "z"]),
        ("gough_stewart", &["x", "y", "z"]),
    ] {
        let mechanism = load(name);
        let scene = nominal(&mechanism);
        for coordinate in coordinates {
            assert!(joint_places(&scene, coordinate).is_empty(), "{name}: {coordinate}");
        }
        // Each leg begins at the base; nothing else does.
        let grounds = scene
            .marks
            .iter()
            .filter(|mark| matches!(mark.shape, MarkShape::Ground(_)));
        assert_eq!(grounds.count(), if name == "gough_stewart" { 6 } else { 3 }, "{name}");
    }
    for (name, joints) in [
        ("spidermill", 4),
        ("five_bar", 4),
        ("scara", 4),
        ("stanford", 6),
        ("emps", 1),
    ] {
        let scene = nominal(&load(name));
        let drawn = scene
            .marks
            .iter()
            .filter(|mark| matches!(mark.shape, MarkShape::Joint(_)));
        assert_eq!(drawn.count(), joints, "{name}");
    }
}

/// The last link of an arm is a link too.
#[test]
fn last_links_are_drawn_as_links() {
    for (name, links) in [("two_link", 2), ("parallelogram", 3)] {
        let scene = nominal(&load(name));
        let mut bodies: Vec<usize> = (scene.marks.iter())
            .filter(|mark| matches!(mark.shape, MarkShape::Bar(_)) && mark.body != 0)
            .map(|mark| mark.body)
            .collect();
        bodies.sort_unstable();
        bodies.dedup();
        assert_eq!(bodies.len(), links, "{name}");
    }
}

/// No two names lie over each other in the picture of any bundled model.
#[test]
fn names_do_not_overlap() {
    for file in bundled() {
        let mechanism = modelmill_spec::load_file(&file).expect("a bundled model").mechanism;
        let scene = nominal(&mechanism);
        let text = svg(&[&scene], &scene.best_view(), &DrawingStyle::default());
        let document = roxmltree::Document::parse(&text).expect("well-formed SVG");
        let names = document.descendants().filter(|node| {
            let class = node.attribute("class").unwrap_or_default();
            node.tag_name().name() == "text" && class.starts_with("of-")
        });
        // Left, right and base line, by the mean width of a letter.
        let boxes: Vec<([f64; 3], &str)> = names
            .map(|node| {
                let value =
                    |name: &str| -> f64 { node.attribute(name).and_then(|v| v.parse().ok()).expect("a number") };
                let says = node.text().unwrap_or_default();
                let width = 6.4 * says.chars().count() as f64;
                let left = match node.attribute("text-anchor") {
                    Some("start") => value("x"),
                    Some("end") => value("x") - width,
                    _ => value("x") - 0.5 * width,
                };
                ([left, left + width, value("y")], says)
            })
            .collect();
        for (i, (a, one)) in boxes.iter().enumerate() {
            for (b, other) in &boxes[i + 1..] {
                let is_apart = a[1] <= b[0] + 0.2 || b[1] <= a[0] + 0.2 || (a[2] - b[2]).abs() > 11.8;
                assert!(is_apart, "{}: {one} over {other}", mechanism.name);
            }
        }
        let joints = scene.marks.iter().filter(|mark| {
            matches!(
                mark.shape,
                MarkShape::Joint(_) | MarkShape::Drive(_) | MarkShape::Point(_)
            ) && !mark.name.is_empty()
        });
        let joints = joints.count();
        assert!(
            boxes.len() * 10 >= joints * 8,
            "{}: {} of {joints} names",
            mechanism.name,
            boxes.len()
        );
    }
}

/// No arm of a delta robot is seen from its end, though one of the three lies along most views.
#[test]
fn the_view_hides_no_arm() {
    let scene = nominal(&load("delta"));
    let view = scene.best_view();
    for name in ["arm1", "arm2", "arm3"] {
        let bars = scene.marks.iter().filter(|mark| mark.description == name);
        let shares = bars.filter_map(|mark| match &mark.shape {
            MarkShape::Bar([a, b]) => {
                let [right, up] = view.project(&(b - a));
                Some(right.hypot(up) / (b - a).norm())
            }
            _ => None,
        });
        let share = shares.fold(f64::INFINITY, f64::min);
        assert!(share > 0.35 && share <= 1.0, "{name}: {share}");
    }
}
