//! Entry of the solver: runs in a worker beside the laboratory's replay.

fn main() {
    sidestep_web::browser::solver::work();
}
