//! Motion beyond the tables of coordinates that follow others. A recording goes in; notes come out.

use modelmill_identify::{RecordingNote, SignalRecording as Raw};
use modelmill_spec::{Mechanism, ModelSymbol};

/// One note for each table whose argument leaves its interval along a recording: the model continues tables by straight
/// lines there. Tables over coordinates that are not recorded are not checked.
pub(super) fn note_beyond_tables(mechanism: &Mechanism, raw: &Raw) -> Vec<RecordingNote> {
    let mut notes = Vec::new();
    for coupling in &mechanism.couplings {
        let Some((function, table)) = coupling.function.as_ref().and_then(|f| Some((f, f.table.as_ref()?))) else {
            continue;
        };
        let columns = function
            .leaders
            .iter()
            .map(|i| raw.column(&mechanism.coordinates[i.0].name).ok());
        let Some(columns) = columns.collect::<Option<Vec<&[f64]>>>() else {
            continue;
        };
        let argument = |sample: usize| {
            table.argument.evaluate(&|symbol| match symbol {
                ModelSymbol::Coordinate(i) => {
                    let place = function.leaders.iter().position(|leader| *leader == i);
                    place.map_or(f64::NAN, |k| columns[k][sample])
                }
                other => mechanism.symbol_nominal(other),
            })
        };
        let [low, high] = table.ends;
        let beyond = (0..raw.samples()).filter(|sample| {
            let x = argument(*sample);
            x < low || x > high
        });
        let n_beyond = beyond.count();
        if n_beyond > 0 {
            let name = &mechanism.coordinates[coupling.coordinate.0].name;
            notes.push(RecordingNote::warning(format!(
                "The table of `{name}` ends at {low} and {high}, and {n_beyond} of {} samples of {} are beyond it. The model \
                 continues the table by a straight line there, and its forces may be wrong. Give the table more rows.",
                raw.samples(),
                raw.file()
            )));
        }
    }
    notes
}
