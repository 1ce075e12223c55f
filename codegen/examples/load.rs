fn main() {
    for path in std::env::args().skip(1) {
        let l = match modelmill_spec::load_file(std::path::Path::new(&path)) {
            Ok(l) => l,
            Err(e) => {
                println!("{}", e.render(false));
                continue;
            }
        };
        let m = &l.mechanism;
        let t = std::time::Instant::now();
        match modelmill_codegen::derive(m) {
            Ok(d) => {
                println!(
                    "{}: rank {} products {} without {} time {:?} nodes {} {}",
                    m.name,
                    d.reduction.retained.len(),
                    d.reduction.products.len(),
                    d.reduction.without_effect.len(),
                    t.elapsed(),
                    d.graph.len(),
                    match d.programs.passive_position {
                        modelmill_codegen::PassivePosition::None => "",
                        modelmill_codegen::PassivePosition::Closed => "closed",
                        _ => "newton",
                    }
                );
                let pr = &d.programs;
                let s = modelmill_codegen::Stage::State;
                println!(
                    "   regressor {} = {}",
                    pr.regressor.count(s),
                    pr.regressor.count(s).add + pr.regressor.count(s).mul
                );
                println!(
                    "   id        {} = {}",
                    pr.inverse_dynamics.count(s),
                    pr.inverse_dynamics.count(s).add + pr.inverse_dynamics.count(s).mul
                );
                if std::env::var("V").is_ok() {
                    for l in &d.reduction.dependencies {
                        print!("  h_{} =", d.reduction.products[l.product].text(m));
                        for (k, f) in &l.equals {
                            print!(
                                " + {:?}/{:?} h_{}",
                                f.numerator,
                                f.denominator,
                                d.reduction.products[d.reduction.retained[*k]].text(m)
                            );
                        }
                        println!();
                    }
                }
            }
            Err(e) => println!("{}: {e}", m.name),
        }
    }
}
