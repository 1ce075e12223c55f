//! Chapter 4 of the page: the two causes that the authors name, and the diagnosis in their situation.

use modelmill::text::table::significant;

use crate::page::ExperimentPage;
use crate::wording::{change, millimetres, nominal, percent};
use crate::{PaperExperiment, causes, printed};

impl ExperimentPage {
    /// Chapter 4: lever arms, contact points, and a diagnosis with the parameters from CAD.
    pub(crate) fn causes(&mut self, experiment: &PaperExperiment) {
        let causes = &experiment.causes;
        self.heading("4  The two causes that the paper names");
        self.paragraph(
            "The paper (section 5) writes that the errors of the reduced model mainly result from the places of the point \
             masses for the coupling elements G2 and G6 and the platform G4: in the multibody model the lever arms from \
             the base to the centres of the triangular elements, and from these to the centre of G4, are longer. The \
             contact points A of the spindle forces contribute in addition.",
        );
        self.paragraph(&format!(
            "Lever arms: refuted. G2, G6 and G4 do not rotate, so every point of such a body has the same acceleration, \
             and where its centre is has no effect on the spindle forces. Moved by {} mm along x and y, all three \
             together, the forces of the complete robot change by {} of the largest force. Step 2 of the reduction, the \
             point masses at R2m, R3m and R4m, is exact; `modelmill reduce` measures the same. The error comes from \
             the same bodies, but from the equations: m4 acts at two places (section 3).",
            millimetres(causes::SHIFT),
            change(causes.moved_centres),
        ));
        self.paragraph(
            "Contact points: confirmed. The reduction puts them on the axes of the cranks. If they are beside the axes, \
             an error remains that no base parameter can represent. The errors of the paper's treatment follow. The mean \
             relative error is the paper's measure. It depends on the samples near zero force, and changes by up to 60 % \
             with the sampling rate; the nrms does not. So it shows the order of size, and no distance to a millimetre:",
        );
        self.contact_table(experiment);
        self.held_diagnosis(experiment);
    }

    /// Table 2 with contact points beside the axes.
    fn contact_table(&mut self, experiment: &PaperExperiment) {
        let contacts = &experiment.causes.contacts;
        let mut head = vec!["run".to_owned(), "*paper".to_owned()];
        for contact in contacts {
            let offset = millimetres(contact.offset);
            head.extend([format!("{offset} mm: mean"), format!("{offset} mm: nrms")]);
        }
        let mut rows = Vec::new();
        for (k, run) in ["identification", "verification"].into_iter().enumerate() {
            for (s, stage) in ["calculated", "estimated"].into_iter().enumerate() {
                for (d, name) in ["fe1, left", "fe10, right"].into_iter().enumerate() {
                    let mut row = vec![
                        format!("{run}, {stage}, {name}"),
                        format!("{:.2} %", printed::TABLE_2[s][d][k]),
                    ];
                    for contact in contacts {
                        let along = &contact.study.runs[k];
                        let modelled = if s == 0 {
                            &along.calculated[0]
                        } else {
                            &along.estimated[0]
                        };
                        let errors = along.errors(d, modelled);
                        row.extend([errors.mean_relative, errors.nrms].map(percent));
                    }
                    rows.push(row);
                }
            }
        }
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        self.table(&head, &rows);
    }

    /// The diagnosis with fixed parameters.
    fn held_diagnosis(&mut self, experiment: &PaperExperiment) {
        let held = &experiment.causes.held;
        self.paragraph(&format!(
            "The tool in the authors' situation: parameters from CAD, and recordings of the robot with contact points {} \
             mm beside the axes. The model is the paper's, with a constant eA = 0 for the distance. `modelmill diagnose \
             --held` fixes all parameters at their CAD values. The constant eA names the distance; no other \
             information about the error is given.",
            millimetres(held.offset)
        ));
        let [mass, offset] = held.first;
        let (Some(mass), Some(offset)) = (mass, offset) else {
            self.paragraph("It does not find both the misplaced mass and the distance here.");
            return;
        };
        let alternatives = match held.alternatives.as_slice() {
            [] => String::new(),
            others => format!(
                " With these recordings the distance is not distinguishable from {}.",
                others.join(", ")
            ),
        };
        let second = held.second.map_or_else(String::new, |mass| {
            format!(
                " With this distance in the model file, the second diagnosis finds m4 = {} kg.",
                significant(mass, 5)
            )
        });
        self.paragraph(&format!(
            "It finds both: m4 = {} kg is misplaced (truth: {} kg), and eA = {} mm (truth: {} mm). The error on the \
             verification run falls from {} to {} (nrms).{alternatives}{second}",
            significant(mass, 5),
            nominal(experiment, "m4"),
            significant(1000.0 * offset, 4),
            millimetres(held.offset),
            percent(held.errors[0]),
            percent(held.errors[1]),
        ));
    }
}
