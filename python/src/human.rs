//! Models of the human's actions: a trained model or a Python function.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use sidestep::bounds::{self, ActionSpace};
use sidestep::invalid::Invalid;
use sidestep::safety;
use sidestep::scene::{self, JointState};
use sidestep::shfrs::PredictedHuman;

use crate::arrays::{list, states_array};
use crate::error::Error;
use crate::function::{SafetyLevels, levels};
use crate::kept::New;
use crate::predictor::Predictor;
use crate::vehicles::SceneParameters;

/// A user-defined model: a function that returns the probability of each action of the human.
///
/// `OnlinePredictor` does not accept it. Use `Predictor.constant` or `sidestep.from_sklearn` to make a model
/// for `OnlinePredictor`.
///
/// Parameters
/// ----------
/// actions : array of float64, shape (n,)
///     The turn rate of each action (rad/s, left positive). With `bins`, the n edges of n − 1 bins, ascending.
/// probabilities : callable
///     Called as `probabilities(history)`. `history` has the joint states since the start of the trial,
///     including predicted ones, as an array of shape (t, 2, 3). Returns the probability of each action,
///     shape (n,), or of each bin, shape (n − 1,). The result must depend only on the states.
/// bins : bool
///     Whether the human chooses any turn rate of a range. Within a bin, all turn rates are equally probable. A
///     bin between two equal edges is a single turn rate, such as 0. Sets then need `q` instead of `k` or `tau`.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct ActionModel {
    actions: Vec<f64>,
    bins: bool,
    probabilities: Py<PyAny>,
}

#[pymethods]
impl ActionModel {
    #[new]
    #[pyo3(signature = (actions, probabilities, *, bins=false))]
    fn new(
        actions: &Bound<'_, PyAny>,
        probabilities: Py<PyAny>,
        bins: bool,
    ) -> Result<Self, Error> {
        let py = actions.py();
        let actions = list("actions", actions)?;
        let model = Self { actions, bins, probabilities };
        model.space().check()?;
        let probabilities = &model.probabilities;
        if !probabilities.bind(py).is_callable() {
            let found = probabilities.bind(py).get_type();
            return Err(Invalid::new("probabilities", "a callable", found).into());
        }
        Ok(model)
    }

    /// The turn rate of each action, or the edges of bins (rad/s).
    #[getter]
    fn actions(&self) -> Vec<f64> {
        self.actions.clone()
    }

    /// Whether `actions` are the edges of bins.
    #[getter]
    fn bins(&self) -> bool {
        self.bins
    }

    /// Whether the turn rates are the same and Python considers the functions equal.
    fn __eq__(&self, py: Python<'_>, other: &Self) -> PyResult<bool> {
        let same = self.space() == other.space();
        Ok(same && self.probabilities.bind(py).eq(&other.probabilities)?)
    }

    fn __hash__(&self) -> usize {
        self.actions.len()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<New<'py, (Vec<f64>, Py<PyAny>)>> {
        let named = PyDict::new(py);
        named.set_item("bins", self.bins)?;
        Ok(((self.actions.clone(), self.probabilities.clone_ref(py)), named))
    }

    fn __repr__(&self) -> String {
        let bins = if self.bins { ", bins=True" } else { "" };
        format!("ActionModel(actions={:?}, …{bins})", self.actions)
    }
}

impl ActionModel {
    fn space(&self) -> ActionSpace<'_> {
        match self.bins {
            true => ActionSpace::Bins(&self.actions),
            false => ActionSpace::Levels(&self.actions),
        }
    }
}

/// A model as an argument.
#[derive(FromPyObject)]
pub(crate) enum Model<'py> {
    /// A trained model.
    Trained(Bound<'py, Predictor>),
    /// A Python function.
    Own(Bound<'py, ActionModel>),
}

/// A model, the parameters of its scene, and its safety levels if it needs them.
pub(crate) type Arguments<'py> = (Bound<'py, PyAny>, SceneParameters, Option<SafetyLevels>);

/// A model in its scene. It outlives the call that created it.
pub(crate) struct Human {
    model: Kept,
    pub(crate) parameters: scene::SceneParameters,
}

enum Kept {
    Trained(Py<Predictor>, Box<safety::SafetyLevels>),
    Own(Py<ActionModel>),
}

impl Human {
    /// Creates the human with these parameters, predicted by `model`.
    pub(crate) fn new(
        model: Model<'_>,
        parameters: &scene::SceneParameters,
        safety: Option<SafetyLevels>,
    ) -> Result<Self, Error> {
        let model = match model {
            Model::Trained(predictor) => {
                let features = predictor.get().of_turns()?.features();
                let safety = levels(features, parameters, safety)?;
                Kept::Trained(predictor.unbind(), Box::new(safety))
            }
            Model::Own(model) => Kept::Own(model.unbind()),
        };
        let human = Self { model, parameters: *parameters };
        human.learned()?;
        Ok(human)
    }

    /// The learned function G of Algorithm 1.
    fn learned(&self) -> Result<Learned<'_>, Error> {
        let model = match &self.model {
            Kept::Trained(predictor, safety) => {
                let human =
                    PredictedHuman::new(&predictor.get().predictor, safety, &self.parameters);
                G::Trained(human.map_err(|invalid| invalid.within("model"))?)
            }
            Kept::Own(model) => G::Own(model.get()),
        };
        Ok(Learned { model, raised: Mutex::new(None) })
    }

    /// Whether this human has these parameters and is predicted by this predictor.
    pub(crate) fn predicted_by(
        &self,
        predictor: &Predictor,
        parameters: &scene::SceneParameters,
    ) -> bool {
        let model = matches!(&self.model, Kept::Trained(own, _) if own.get() == predictor);
        model && self.parameters == *parameters
    }

    /// Whether both have the same model and the same parameters.
    pub(crate) fn same(&self, other: &Self) -> bool {
        let model = match (&self.model, &other.model) {
            (Kept::Trained(one, _), Kept::Trained(other, _)) => one.get() == other.get(),
            (Kept::Own(one), Kept::Own(other)) => Python::attach(|py| {
                one.is(other) || one.get().__eq__(py, other.get()).unwrap_or(false)
            }),
            _ => false,
        };
        model && self.parameters == other.parameters
    }

    /// Arguments that recreate this human: the model, the parameters, and the safety levels if the model
    /// needs them.
    pub(crate) fn arguments<'py>(&self, py: Python<'py>) -> Arguments<'py> {
        let parameters = SceneParameters(self.parameters);
        match &self.model {
            Kept::Trained(predictor, safety) => {
                let features = predictor.get().predictor.features();
                let alike = self.parameters.game(scene::Evader::Human).identical();
                let needed = features.of_game().is_some() && !alike;
                let safety = needed.then(|| SafetyLevels((**safety).clone()));
                (predictor.bind(py).clone().into_any(), parameters, safety)
            }
            Kept::Own(model) => (model.bind(py).clone().into_any(), parameters, None),
        }
    }

    /// The trained predictor. `None` for a Python function.
    pub(crate) fn predictor(&self) -> Option<&Predictor> {
        match &self.model {
            Kept::Trained(predictor, _) => Some(predictor.get()),
            Kept::Own(_) => None,
        }
    }

    /// Number of actions in the model.
    pub(crate) fn actions(&self) -> usize {
        match &self.model {
            Kept::Trained(predictor, _) => predictor.get().predictor.classes().len(),
            Kept::Own(model) => model.get().space().len(),
        }
    }

    /// Runs library code with the model while the interpreter is released. An exception raised by a Python
    /// function takes precedence over the library errors that follow from it.
    pub(crate) fn work<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Learned<'_>) -> Result<T, Invalid> + Send,
    ) -> Result<T, Error> {
        let learned = self.learned()?;
        let result = py.detach(|| work(&learned));
        match learned.raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(raised) => Err(raised),
            None => Ok(result?),
        }
    }
}

/// The learned function G, while library code uses it.
pub(crate) struct Learned<'a> {
    model: G<'a>,
    /// The first exception raised by a Python function.
    raised: Mutex<Option<Error>>,
}

enum G<'a> {
    Trained(PredictedHuman<'a>),
    Own(&'a ActionModel),
}

impl bounds::ActionModel for Learned<'_> {
    fn actions(&self) -> ActionSpace<'_> {
        match &self.model {
            G::Trained(human) => bounds::ActionModel::actions(human),
            G::Own(model) => model.space(),
        }
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        match &self.model {
            G::Trained(human) => human.probabilities(history, out),
            G::Own(model) => {
                if let Err(raised) = ask(model, history, out) {
                    // NaN probabilities make Algorithm 1 stop.
                    out.fill(f64::NAN);
                    let mut first = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
                    first.get_or_insert(raised);
                }
            }
        }
    }
}

/// Calls a Python function to get the probability of each action.
fn ask(model: &ActionModel, history: &[JointState], out: &mut [f64]) -> Result<(), Error> {
    Python::attach(|py| {
        py.check_signals()?;
        let answer = model.probabilities.bind(py).call1((states_array(py, history)?,))?;
        let found = list("probabilities", &answer)?;
        if found.len() != out.len() {
            let each = if model.bins { "bin" } else { "action" };
            let expected = format!("{} numbers, one for each {each}", out.len());
            return Err(Invalid::new("probabilities", expected, found.len()).into());
        }
        out.copy_from_slice(&found);
        Ok(())
    })
}
