//! Entry point of the simulator, which operates the participant's page in a simulated
//! participation.

fn main() {
    sidestep_web::browser::simulator::work();
}
