//! Entry point of the solver, which runs in a worker for the laboratory's pages.

fn main() {
    sidestep_web::browser::solver::work();
}
