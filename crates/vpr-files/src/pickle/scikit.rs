//! The names that pickles of scikit-learn's estimators call. An estimator is read as a record of its
//! fields; nothing of it is made or called.

use super::object::{Arena, Global, Name, Node, Object};

/// Why something was refused; the caller knows where.
type Reason = String;

/// Looks up what a pickle of estimators names; `None` if it is not on the list.
///
/// Modules are those of scikit-learn before 0.22 and since.
pub(super) fn global(module: &str, name: &str) -> Option<Global> {
    Some(match (module, name) {
        ("sklearn.decomposition.pca" | "sklearn.decomposition._pca", "PCA") => {
            Global::Estimator("PCA")
        }
        ("sklearn.cluster.k_means_" | "sklearn.cluster._kmeans", "KMeans") => {
            Global::Estimator("KMeans")
        }
        ("sklearn.cluster.k_means_" | "sklearn.cluster._kmeans", "MiniBatchKMeans") => {
            Global::Estimator("MiniBatchKMeans")
        }
        ("copyreg" | "copy_reg", "_reconstructor") => Global::Reconstructor,
        ("builtins" | "__builtin__", "object") => Global::ObjectBase,
        ("collections", "OrderedDict") => Global::Torch(Name::OrderedDict),
        ("collections", "defaultdict") => Global::DefaultDict,
        ("builtins" | "__builtin__", "dict" | "list") => Global::Torch(Name::Inert),
        _ => return None,
    })
}

/// An estimator without its fields, of what `copyreg._reconstructor` is called with.
pub(super) fn reconstructed<'a>(
    arena: &Arena<'a>,
    arguments: Node<'a>,
) -> Result<Object<'a>, Reason> {
    match arena.tuple(arguments) {
        Some(
            &[Node::Global(Global::Estimator(class)), Node::Global(Global::ObjectBase), Node::None],
        ) => Ok(Object::Record { class, fields: None }),
        _ => Err("_reconstructor makes what is not an estimator".into()),
    }
}

/// An estimator without its fields, of a class and the arguments of NEWOBJ, which are none.
pub(super) fn new<'a>(
    arena: &Arena<'a>,
    class: &'static str,
    arguments: Node<'a>,
) -> Result<Object<'a>, Reason> {
    match arena.tuple(arguments) {
        Some([]) => Ok(Object::Record { class, fields: None }),
        _ => Err(format!("a {class} is made from arguments")),
    }
}

/// Gives an estimator its fields, a dictionary.
pub(super) fn build<'a>(arena: &mut Arena<'a>, id: usize, state: Node<'a>) -> Result<(), Reason> {
    let Node::Object(fields) = state else {
        return Err("the fields of an estimator are not a dict".into());
    };
    if !matches!(arena.get(fields), Object::Dict(_)) {
        return Err("the fields of an estimator are not a dict".into());
    }
    match arena.get_mut(id) {
        Object::Record { fields: slot @ None, .. } => *slot = Some(fields),
        _ => return Err("the estimator has its fields already".into()),
    }
    Ok(())
}
