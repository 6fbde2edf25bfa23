//! Entry of the simulator: runs beside the participant's page in a simulated participation.

fn main() {
    sidestep_web::browser::simulator::work();
}
