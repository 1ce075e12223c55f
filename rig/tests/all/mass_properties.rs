//! Mass properties from CAD programs: planted bodies, printed in the layout of each program, are read back; what is not
//! known is refused.

use std::fmt::Write as _;

use modelmill_boundary::files::MemoryFiles;
use modelmill_rig::{LoadedRig, RigState, RigTracker, forces, load};
use modelmill_runtime::RandomBits;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// A body of point masses.
struct Planted {
    mass: f64,
    centre: Vector3<f64>,
    tensor: Matrix3<f64>,
}

/// A number between -1 and 1.
fn draw(draws: &mut RandomBits) -> f64 {
    2.0 * draws.below_one() - 1.0
}

fn planted(seed: u64) -> Planted {
    let mut draws = RandomBits::new(seed);
    let points: Vec<(f64, Vector3<f64>)> = (0..6)
        .map(|_| {
            let mass = 0.5 + draws.below_one();
            (
                mass,
                Vector3::new(draw(&mut draws), draw(&mut draws), draw(&mut draws)) * 0.4 + Vector3::new(0.3, -0.2, 0.1),
            )
        })
        .collect();
    let mass = points.iter().map(|(m, _)| m).sum();
    let centre = points.iter().map(|(m, p)| *m * p).sum::<Vector3<f64>>() / mass;
    let tensor = tensor_about(&points, centre);
    Planted { mass, centre, tensor }
}

fn tensor_about(points: &[(f64, Vector3<f64>)], origin: Vector3<f64>) -> Matrix3<f64> {
    let one = |(m, p): &(f64, Vector3<f64>)| {
        let d = p - origin;
        *m * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
    };
    points.iter().map(one).sum()
}

impl Planted {
    /// The tensor about the origin.
    fn at_origin(&self) -> Matrix3<f64> {
        let c = self.centre;
        self.tensor + self.mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose())
    }
}

/// The rows of a matrix as a report prints them; `sign` multiplies the products.
fn entries(letter: char, t: &Matrix3<f64>, sign: f64, unit: &str, equals: &str) -> String {
    let mut text = String::new();
    for (i, a) in "xyz".chars().enumerate() {
        for (j, b) in "xyz".chars().enumerate() {
            let factor = if i == j { 1.0 } else { sign };
            let _ = write!(text, "\t{letter}{a}{b}{equals}{:.9e}{unit}", factor * t[(i, j)]);
        }
        text.push('\n');
    }
    text
}

fn solidworks(body: &Planted, sign: f64) -> String {
    let c = body.centre * 1e3;
    format!(
        "Mass properties of G1\n     Configuration: Default\n     Coordinate system: -- default --\n\nMass = {:.6} grams\n\n\
         Volume = 4000000.00 cubic millimeters\n\nSurface area = 1.0  square millimeters\n\nCenter of mass: ( millimeters )\n\
         \tX = {:.6}\n\tY = {:.6}\n\tZ = {:.6}\n\nMoments of inertia: ( grams *  square millimeters )\nTaken at the center of \
         mass and aligned with the output coordinate system.\n{}\nMoments of inertia: ( grams *  square millimeters )\nTaken \
         at the output coordinate system.\n{}",
        body.mass * 1e3,
        c.x,
        c.y,
        c.z,
        entries('L', &(body.tensor * 1e9), sign, "", " = "),
        entries('I', &(body.at_origin() * 1e9), sign, "", " = ")
    )
}

fn creo(body: &Planted) -> String {
    let c = body.centre * 1e3;
    let block = |t: Matrix3<f64>| {
        (0..3).fold("INERTIA TENSOR:\n".to_owned(), |mut text, i| {
            let row = ["Ixx Ixy Ixz", "Iyx Iyy Iyz", "Izx Izy Izz"][i];
            let _ = writeln!(text, "{row}  {:.9e}  {:.9e}  {:.9e}", t[(i, 0)], t[(i, 1)], t[(i, 2)]);
            text
        })
    };
    format!(
        "MASS PROPERTIES OF THE PART G1\n\nVOLUME =  4.0000000e+06  MM^3\nSURFACE AREA =  4.0e+02  MM^2\nMASS = {:.9e} \
         KILOGRAM\n\nCENTER OF GRAVITY with respect to _G1 coordinate frame:\nX   Y   Z     {:.9e}  {:.9e}  {:.9e}  MM\n\n\
         INERTIA with respect to _G1 coordinate frame:  (KILOGRAM * MM^2)\n\n{}\nINERTIA at CENTER OF GRAVITY with respect \
         to _G1 coordinate frame:  (KILOGRAM * MM^2)\n\n{}\nRADII OF GYRATION with respect to PRINCIPAL AXES:\nR1  R2  R3  \
         1 2 3 MM\n",
        body.mass,
        c.x,
        c.y,
        c.z,
        block(body.at_origin() * 1e6),
        block(body.tensor * 1e6)
    )
}

fn inventor(body: &Planted) -> String {
    let c = body.centre * 1e3;
    let half = |t: &Matrix3<f64>| {
        let mut text = String::new();
        for (i, a) in "xyz".chars().enumerate() {
            for (j, b) in "xyz".chars().enumerate().take(i + 1) {
                let _ = write!(
                    text,
                    "\tI{a}{b}\t{:.9e} kg mm^2 (Relative Error = 0.000001%)",
                    t[(i, j)]
                );
            }
            text.push('\n');
        }
        text
    };
    format!(
        "Physical Properties for G1\nGeneral Properties:\n\tMaterial:\t{{Steel}}\n\tDensity:\t7.850 g/cm^3\n\tMass:\t{:.9} kg \
         (Relative Error = 0.000001%)\n\tVolume:\t4000000.0 mm^3\nCenter of Gravity:\n\tX:\t{:.6} mm (Relative Error = \
         0.000001%)\n\tY:\t{:.6} mm\n\tZ:\t{:.6} mm\nMass Moments of Inertia with respect to Center of Gravity(Calculated using \
         negative integral)\n{}Principal Moments of Inertia with respect to Center of Gravity\n\tI1:\t1e9 kg mm^2\n",
        body.mass,
        c.x,
        c.y,
        c.z,
        half(&(body.tensor * 1e6))
    )
}

fn solid_edge(body: &Planted) -> String {
    let o = body.at_origin();
    let moments = body.tensor.symmetric_eigenvalues();
    format!(
        "Physical Properties Report\n\nMass:\t{:.9} kg\nVolume:\t4000000 mm^3\n\nCenter of Mass:\n\tX = {:.9} m\tY = {:.9} m\tZ = \
         {:.9} m\n\nMass Moments of Inertia (Global):\n\tIxx = {:.9e} kg-m^2\tIyy = {:.9e} kg-m^2\tIzz = {:.9e} kg-m^2\n\tIxy = \
         {:.9e} kg-m^2\tIxz = {:.9e} kg-m^2\tIyz = {:.9e} kg-m^2\n\nPrincipal Moments of Inertia:\n\tI1 = {:.9e} kg-m^2\tI2 = \
         {:.9e} kg-m^2\tI3 = {:.9e} kg-m^2\n",
        body.mass,
        body.centre.x,
        body.centre.y,
        body.centre.z,
        o[(0, 0)],
        o[(1, 1)],
        o[(2, 2)],
        -o[(0, 1)],
        -o[(0, 2)],
        -o[(1, 2)],
        moments[0],
        moments[1],
        moments[2]
    )
}

fn onshape(body: &Planted) -> String {
    format!(
        "Mass properties of G1\nMass: {:.9} kg\nVolume: 0.004 m^3\nCenter of mass: (m)\nX: {:.9} Y: {:.9} Z: {:.9}\nMoments of inertia: \
         (kg m²)\n{}",
        body.mass,
        body.centre.x,
        body.centre.y,
        body.centre.z,
        entries('L', &body.tensor, 1.0, "", ": ")
    )
}

/// A rig with one hinge, whose body has its mass properties in a file.
fn rig_with(entry: &str, name: &str, text: &str) -> Result<LoadedRig, String> {
    let rig = format!(
        "schema = 1\nname = \"arm\"\ngravity = [0, -9.81, 0]\n\n[[mass_properties]]\nfile = \"{name}\"\n{entry}\n\n[[joint]]\nname = \
         \"hinge\"\nkind = \"revolute\"\nbetween = [\"base\", \"G1\"]\nat = [0.1, 0.2, 0]\n\n[[coordinate]]\nname = \"q\"\njoint = \
         \"hinge\"\n\n[[drive]]\nname = \"motor\"\njoint = \"hinge\"\n"
    );
    let files = MemoryFiles::default().with_file(name, text);
    load("arm.toml", &rig, &files).map_err(|failure| failure.render(false))
}

fn assert_body(loaded: &LoadedRig, truth: &Planted, tolerance: f64, what: &str) {
    let body = &loaded.rig.bodies[0];
    assert_eq!(body.name, "G1");
    assert!(
        (body.mass - truth.mass).abs() < tolerance * truth.mass,
        "{what}: {}",
        body.mass
    );
    assert!(
        (body.centre - truth.centre).amax() < tolerance,
        "{what}: {}",
        body.centre
    );
    assert!(
        (body.inertia - truth.tensor).amax() < tolerance * truth.tensor.amax(),
        "{what}: {} {}",
        body.inertia,
        truth.tensor
    );
}

#[test]
fn reports_of_five_programs_are_read() {
    for seed in 0..8 {
        let truth = planted(seed);
        let assembly = "coordinates = \"assembly\"";
        let reports = [
            ("SolidWorks, products", solidworks(&truth, -1.0), String::new()),
            ("SolidWorks, tensor", solidworks(&truth, 1.0), String::new()),
            ("Creo", creo(&truth), String::new()),
            ("Inventor", inventor(&truth), String::new()),
            ("Solid Edge", solid_edge(&truth), "body = \"G1\"".to_owned()),
            ("Onshape", onshape(&truth), "products = \"negative\"".to_owned()),
        ];
        for (program, text, more) in reports {
            let loaded = rig_with(&format!("{assembly}\n{more}"), "G1.txt", &text);
            let loaded = loaded.unwrap_or_else(|says| panic!("{program}: {says}\n{text}"));
            assert_body(&loaded, &truth, 1e-6, program);
            // A sign that is stated and not confirmed is remarked.
            let is_open = ["Onshape", "Inventor"].contains(&program);
            assert!(is_open || loaded.remarks.is_empty(), "{program}: {:?}", loaded.remarks);
        }
    }
}

/// Values of a leg of the robot ATRIAS, as SolidWorks printed them: the inertias about both points determine the sign.
#[test]
fn printed_values_of_a_real_robot_determine_the_sign() {
    let text = "Mass properties of G1\nMass = 21.48285668 kilograms\nCenter of mass: ( meters )\n| X = 0.15699680 |\n| Y = \
                -0.03205624 |\n| Z = -0.00092478 |\nMoments of inertia: ( kilograms * square meters )\nTaken at the center of \
                mass and aligned with the output coordinate system.\n| Lxx = 0.45452151 | Lxy = -0.00286138 | Lxz = 0.00262687 \
                |\n| Lyx = -0.00286138 | Lyy = 0.19907772  | Lyz = 0.00888237 |\n| Lzx = 0.00262687 | Lzy = 0.00888237  | Lzz \
                = 0.39747541 |\nMoments of inertia: ( kilograms * square meters )\nTaken at the output coordinate system.\n| \
                Ixx = 0.47661572 | Ixy = -0.11097872 | Ixz = -0.00049218 |\n| Iyx = -0.11097872 | Iyy = 0.72860543  | Iyz = \
                0.00951923  |\n| Izx = -0.00049218 | Izy = 0.00951923  | Izz = 0.94906058  |\n";
    let rig = rig_with("coordinates = \"assembly\"", "leg.txt", text)
        .expect("a rig")
        .rig;
    let tensor = rig.bodies[0].inertia;
    assert!(
        (tensor[(0, 1)] - 0.002_861_38).abs() < 1e-12 && (tensor[(1, 2)] + 0.008_882_37).abs() < 1e-12,
        "{tensor}"
    );
    let wrong =
        rig_with("coordinates = \"assembly\"\nproducts = \"negative\"", "leg.txt", text).expect_err("contradicted");
    assert!(wrong.contains("contradicts other values"), "{wrong}");
}

/// A table in millimetres and grams, about the centre or the origin, with either sign and separator.
#[test]
fn tables_are_read_in_their_units() {
    for seed in 0..8 {
        let truth = planted(seed);
        for (about, t) in [("centre", truth.tensor), ("origin", truth.at_origin())] {
            for (products, sign) in [("positive", -1.0), ("negative", 1.0)] {
                let c = truth.centre * 1e3;
                let header = "part;material;mass [g];x [mm];y [mm];z [mm];Ixx [g mm^2];Iyy [g mm^2];Izz [g mm^2];Ixy [g mm^2];Ixz \
                              [g mm^2];Iyz [g mm^2]";
                let row = [c.x, c.y, c.z, t[(0, 0)] * 1e9, t[(1, 1)] * 1e9, t[(2, 2)] * 1e9]
                    .into_iter()
                    .chain([(0, 1), (0, 2), (1, 2)].map(|at| sign * t[at] * 1e9))
                    .fold(format!("G1;steel;{:.12e}", truth.mass * 1e3), |row, x| {
                        row + &format!(";{x:.12e}")
                    });
                // A decimal comma is accepted where fields have another separator.
                let text = format!("{header}\n{}\n", row.replace('.', ","));
                let entry = format!("coordinates = \"assembly\"\ninertia = \"{about}\"\nproducts = \"{products}\"");
                let loaded = rig_with(&entry, "all.csv", &text).unwrap_or_else(|says| panic!("{says}"));
                assert_body(&loaded, &truth, 1e-9, about);
            }
        }
    }
}

/// The same body in coordinates of the part, with a pose, and in coordinates of the assembly has the same forces.
#[test]
fn coordinates_of_part_and_assembly_agree() {
    let truth = planted(3);
    let (at, rpy) = (Vector3::new(0.4, -0.3, 0.2), [0.3, -0.5, 1.1]);
    let turn = Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    let in_part = Planted {
        mass: truth.mass,
        centre: turn.inverse() * (truth.centre - at),
        tensor: turn.inverse() * truth.tensor * turn,
    };
    let body = format!(
        "coordinates = \"part\"\n\n[[body]]\nname = \"G1\"\nat = [{}, {}, {}]\nrpy = [{}, {}, {}]",
        at.x, at.y, at.z, rpy[0], rpy[1], rpy[2]
    );
    let part = rig_with(&body, "G1.txt", &solidworks(&in_part, -1.0)).unwrap_or_else(|says| panic!("{says}"));
    let assembly = rig_with("coordinates = \"assembly\"", "G1.txt", &solidworks(&truth, -1.0)).expect("a rig");
    let torque = |loaded: &LoadedRig| {
        let mut tracker = RigTracker::new(&loaded.rig).expect("closed joints");
        let state = RigState {
            q: vec![0.4],
            qd: vec![0.7],
            qdd: vec![-1.3],
        };
        forces(&loaded.rig, &tracker.follow(&state).expect("a motion")).expect("forces")[0]
    };
    let (one, two) = (torque(&part), torque(&assembly));
    assert!((one - two).abs() < 1e-7 * one.abs(), "{one} {two}");
}

/// What the file does not state is refused with its place and a remedy.
#[test]
fn missing_and_impossible_values_are_refused() {
    let assembly = "coordinates = \"assembly\"\ninertia = \"centre\"";
    let head = "name,mass [kg],x [m],y [m],z [m],Ixx [kg m^2],Iyy [kg m^2],Izz [kg m^2],Ixy [kg m^2]";
    let cases = [
        (
            assembly,
            "name,mass,x [m],y [m],z [m]\nG1,1,0,0,0\n".to_owned(),
            "all.csv:1:6",
            "unit of `mass` is missing",
        ),
        (
            assembly,
            "name,mass [stone],x [m],y [m],z [m]\nG1,1,0,0,0\n".to_owned(),
            "all.csv:1:6",
            "the unit `stone`",
        ),
        (
            "coordinates = \"assembly\"",
            format!("{head}\nG1,1,0,0,0,1,1,1,0\n"),
            "all.csv:1:1",
            "states the point of the inertia",
        ),
        (
            assembly,
            format!("{head}\nG1,1,0,0,0,1,1,1,0.1\n"),
            "all.csv:2:1",
            "sign of the products",
        ),
        (
            assembly,
            format!("{head}\nG1,1,0,0,0,1,1,3,0\n"),
            "all.csv:2:1",
            "the inertia of `G1` is impossible",
        ),
        (
            assembly,
            format!("{head}\nG1,1,0,,0,1,1,1,0\n"),
            "all.csv:2:1",
            "complete centre of mass",
        ),
        (
            assembly,
            format!("{head}\nG1,one,0,0,0,1,1,1,0\n"),
            "all.csv:2:4",
            "`one` is not a number",
        ),
        (
            assembly,
            format!("{head}\nG1,1,0,0,0,1,1,1,0\nG1,1,0,0,0,1,1,1,0\n"),
            "all.csv:3:1",
            "has mass properties already",
        ),
        (
            "coordinates = \"part\"\ninertia = \"centre\"",
            format!("{head}\nG1,1,0,0,0,1,1,1,0\n"),
            "all.csv:2:1",
            "pose of `G1`",
        ),
        (assembly, "root:x:0:0\n".to_owned(), "arm.toml:6:8", "contains no mass"),
    ];
    for (entry, text, place, says) in cases {
        let failure = rig_with(entry, "all.csv", &text).expect_err(says);
        assert!(
            failure.contains(place) && failure.contains(says),
            "{place} {says}\n{failure}"
        );
        assert!(!failure.contains("root:x"), "{failure}");
    }
}

/// A part without a material has the density of water or none; the remark names the body.
#[test]
fn improbable_densities_are_remarked() {
    let truth = planted(1);
    let text = solidworks(&truth, -1.0).replace("4000000.00", "4000.00");
    let loaded = rig_with("coordinates = \"assembly\"", "G1.txt", &text).expect("a rig");
    assert_eq!(loaded.remarks.len(), 1);
    assert!(loaded.remarks[0].message.contains("density"), "{:?}", loaded.remarks);
}

/// The failure of a rig with one file of mass properties.
fn failure_of(entry: &str, name: &str, text: &str) -> String {
    match rig_with(&format!("coordinates = \"assembly\"\n{entry}"), name, text) {
        Ok(loaded) => panic!("accepted: {}\n{text}", loaded.rig.bodies[0].inertia),
        Err(says) => says,
    }
}

/// The remarks on a rig with one table about the centre of mass.
fn remarks_on(text: &str) -> String {
    let entry = "coordinates = \"assembly\"\ninertia = \"centre\"\nproducts = \"negative\"";
    let loaded = rig_with(entry, "all.csv", text).unwrap_or_else(|says| panic!("{says}"));
    let says: Vec<String> = loaded.remarks.iter().map(|remark| remark.message.clone()).collect();
    says.join("\n")
}

/// A misspelt inertia would make a body a point mass without a word.
#[test]
fn columns_that_seem_to_be_inertias_are_refused() {
    let head = "name,mass [kg],x [m],y [m],z [m]";
    for column in [
        "Ixx_com [kg m^2]",
        "Jxx",
        "MOI_xx",
        "Pxy",
        "inertia about x",
        "third moment [g mm^2]",
    ] {
        let says = failure_of(
            "inertia = \"centre\"",
            "all.csv",
            &format!("{head},{column}\nG1,1,0,0,0,1.00\n"),
        );
        assert!(
            says.contains("seems to be an inertia") && says.contains("`Lxx`"),
            "{says}"
        );
    }
    // Other columns are notes.
    let says = remarks_on(&format!(
        "{head},max_x [mm],area [mm^2],areal weight [kg/m^2]\nG1,1,0,0,0,3,4,5\n"
    ));
    assert!(says.contains("`G1`") && says.contains("point mass"), "{says}");
}

/// What makes an inertia incomplete is remarked: absent products, zeros, few digits. Two of three moments are refused.
#[test]
fn incomplete_inertias_are_remarked() {
    let head = "name,mass [kg],x [m],y [m],z [m],Ixx [kg m^2],Iyy [kg m^2],Izz [kg m^2]";
    let full = format!("{head},Ixy [kg m^2],Ixz [kg m^2],Iyz [kg m^2]");
    let cases = [
        (head, "1.00,1.10,1.20", "not all products"),
        (&full, "0.00,0.00,0.00,0,0,0", "all moments of inertia of `G1` are zero"),
        (&full, "0.02,0.03,0.04,0,0,0", "fewer than three digits"),
        (&full, "0.0212,0.0334,0.0413,0,0,0", ""),
        (&full, "2.12e-5,3.34e-5,4.13e-5,0,0,0", ""),
    ];
    for (head, row, expected) in cases {
        let says = remarks_on(&format!("{head}\nG1,1,0,0,0,{row}\n"));
        assert!(
            says.contains(expected) && (!expected.is_empty() || says.is_empty()),
            "{row}: {says}"
        );
    }
    let says = failure_of(
        "inertia = \"centre\"",
        "all.csv",
        &format!("{head}\nG1,1,0,0,0,1.00,,1.00\n"),
    );
    assert!(says.contains("two of three moments"), "{says}");
}

/// A comma may separate thousands. One other number proves that it is a decimal sign.
#[test]
fn commas_that_may_separate_thousands_are_refused() {
    let head = "name;mass [kg];x [m];y [m];z [m];Izz [kg m^2]";
    let says = failure_of(
        "inertia = \"centre\"",
        "all.csv",
        &format!("{head}\nG1;1,234;0;0;0;2\n"),
    );
    assert!(says.contains("separates thousands"), "{says}");
    let entry = "coordinates = \"assembly\"\ninertia = \"centre\"";
    let loaded = rig_with(entry, "all.csv", &format!("{head}\nG1;1,234;0,25;0;0;2\n")).expect("a rig");
    assert!((loaded.rig.bodies[0].mass - 1.234).abs() < 1e-12);
    let says = failure_of(
        "inertia = \"centre\"",
        "all.csv",
        &format!("{head}\nG1;1.234;0,25;0;0;2\n"),
    );
    assert!(
        says.contains("other numbers of this table have a decimal comma"),
        "{says}"
    );

    let report = onshape(&planted(2));
    let mass = report.lines().find(|line| line.starts_with("Mass:")).expect("a mass");
    for number in ["1.234,56", "1,234", "1.234.567"] {
        let says = failure_of("", "G1.txt", &report.replace(mass, &format!("Mass: {number} kg")));
        assert!(
            says.contains(&format!("`{number}` has a decimal comma or separates thousands")),
            "{says}"
        );
    }
    // A line that nobody needs may have any number.
    let text = format!("{report}\nMass: ").replace("\nMass: ", "\nDensity: 7,850 g/cm^3\nMass: ");
    let text = text.trim_end_matches("Mass: ");
    let loaded = rig_with("coordinates = \"assembly\"\nproducts = \"negative\"", "G1.txt", text);
    assert_body(
        &loaded.unwrap_or_else(|says| panic!("{says}")),
        &planted(2),
        1e-6,
        "density",
    );
}

/// Two reports without a title that is known would become one body with the values of the last.
#[test]
fn values_that_are_stated_twice_are_refused() {
    let untitled = |seed| solid_edge(&planted(seed));
    let both = format!("{}\n{}", untitled(1), untitled(2));
    let says = failure_of("body = \"G1\"", "two.txt", &both);
    for what in [
        "the mass is",
        "the centre of mass is",
        "entry `ixx` is",
        "entry `ixy` is",
    ] {
        assert!(says.contains(&format!("{what} stated twice")), "{what}: {says}");
    }
    let twice = format!("{}\n{}", untitled(1), untitled(1));
    assert!(rig_with("coordinates = \"assembly\"\nbody = \"G1\"", "two.txt", &twice).is_ok());
    let (mut lines, report) = (0, onshape(&planted(1)));
    let asymmetric: String = report
        .split_inclusive('\t')
        .map(|word| {
            lines += usize::from(word.starts_with("Lyx"));
            if word.starts_with("Lyx") {
                "Lyx: 0.123\t".to_owned()
            } else {
                word.to_owned()
            }
        })
        .collect();
    assert_eq!(lines, 1);
    let says = failure_of("products = \"negative\"", "G1.txt", &asymmetric);
    assert!(says.contains("product of inertia xy is stated twice"), "{says}");
    let several = solidworks(&planted(1), -1.0).replace("of G1", "of selected components");
    assert!(failure_of("", "some.txt", &several).contains("has no name"));
}

/// SolidWorks since 2019 states its notation. The truth is the sum over the point masses, without the code under test.
#[test]
fn the_positive_notation_of_solidworks_is_read() {
    let points = [
        (1.0, [0.3, 0.1, 0.2]),
        (2.0, [-0.2, -0.3, 0.1]),
        (1.0, [0.1, 0.5, -0.4]),
    ];
    // All sums of m x, m y and m z vanish, so that the origin is the centre of mass.
    let sum = |i: usize, j: usize| {
        points
            .iter()
            .map(|(m, p): &(f64, [f64; 3])| m * p[i] * p[j])
            .sum::<f64>()
    };
    for k in 0..3 {
        assert!(points.iter().map(|(m, p)| m * p[k]).sum::<f64>().abs() < 1e-15);
    }
    let report = |notation: &str, sign: f64| {
        let moment = |k: usize| sum((k + 1) % 3, (k + 1) % 3) + sum((k + 2) % 3, (k + 2) % 3);
        format!(
            "Mass properties of G1\nMass = 4.00 kilograms\nCenter of mass: ( meters )\n\tX = 0.00\n\tY = 0.00\n\tZ = 0.00\n\
             Moments of inertia: ( kilograms * square meters )\nTaken at the center of mass and aligned with the output \
             coordinate system. (Using {notation} tensor notation.)\n\tLxx = {:.6}\tLxy = {:.6}\tLxz = {:.6}\n\tLyx = \
             {:.6}\tLyy = {:.6}\tLyz = {:.6}\n\tLzx = {:.6}\tLzy = {:.6}\tLzz = {:.6}\n",
            moment(0),
            sign * sum(0, 1),
            sign * sum(0, 2),
            sign * sum(0, 1),
            moment(1),
            sign * sum(1, 2),
            sign * sum(0, 2),
            sign * sum(1, 2),
            moment(2)
        )
    };
    assert!(sum(0, 1) > 0.1);
    for (notation, sign) in [("positive", 1.0), ("negative", -1.0)] {
        let text = report(notation, sign);
        let loaded = rig_with("coordinates = \"assembly\"", "G1.txt", &text).unwrap_or_else(|says| panic!("{says}"));
        let tensor = loaded.rig.bodies[0].inertia;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            assert!((tensor[(i, j)] + sum(i, j)).abs() < 1e-6, "{notation}: {tensor}");
        }
        // The rig file may not state the contrary, nor another point.
        let other = if sign > 0.0 { "negative" } else { "positive" };
        let says = failure_of(&format!("products = \"{other}\""), "G1.txt", &text);
        assert!(says.contains("states the contrary"), "{says}");
        let says = failure_of("inertia = \"origin\"", "G1.txt", &text);
        assert!(says.contains("about the centre of mass"), "{says}");
    }
}

/// Mass properties of a variant would replace the body of the base file with its pose.
#[test]
fn mass_properties_of_a_variant_keep_no_pose_silently() {
    let truth = planted(4);
    let base = "schema = 1\nname = \"arm\"\ngravity = [0, -9.81, 0]\n\n[[body]]\nname = \"G1\"\nat = [0.1, 0.2, 0]\nmass = 1\n\n\
                [[joint]]\nname = \"hinge\"\nkind = \"revolute\"\nbetween = [\"base\", \"G1\"]\nat = [0.1, 0.2, 0]\n\n[[coordinate]]\n\
                name = \"q\"\njoint = \"hinge\"\n\n[[drive]]\nname = \"motor\"\njoint = \"hinge\"\n";
    let variant = |body: &str| {
        let text = format!(
            "schema = 1\nname = \"heavy\"\nextends = \"arm.toml\"\n\n[[mass_properties]]\nfile = \"G1.txt\"\ncoordinates = \
             \"assembly\"\n{body}"
        );
        let files = MemoryFiles::default()
            .with_file("arm.toml", base)
            .with_file("G1.txt", solidworks(&truth, -1.0));
        load("heavy.toml", &text, &files).map_err(|failure| failure.render(false))
    };
    let says = variant("").expect_err("a lost pose");
    assert!(
        says.contains("`G1` of `arm.toml`, which has a pose") && says.contains("heavy.toml:6:8"),
        "{says}"
    );
    let loaded = variant("\n[[body]]\nname = \"G1\"\n").unwrap_or_else(|says| panic!("{says}"));
    assert_body(&loaded, &truth, 1e-6, "variant");
}
