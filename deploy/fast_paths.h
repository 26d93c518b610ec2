/* Included before the C of every module that mypyc has written: see `quicken` in deploy/compile.py.

mypyc leaves NamedTuples and the names of a module to the interpreter's runtime. A step of the
vehicle makes some forty NamedTuples, each by a Python function, `lambda cls, a, b:
tuple.__new__(cls, (a, b))`, and looks up several hundred fields and names. Here each has a path
that gives the same object with fewer instructions; whatever is not plainly such a case takes the
usual path. */

#include <Python.h>

PyObject *CPyDict_GetItem(PyObject *dict, PyObject *key);

/* Entry of the dictionary of a class whose base is tuple, borrowed; NULL for anything else. */
static PyObject *flight_stack_entry(PyTypeObject *type, PyObject **key, const char *name)
{
    if (type->tp_base != &PyTuple_Type || type->tp_dict == NULL) {
        return NULL;
    }
    if (*key == NULL && (*key = PyUnicode_InternFromString(name)) == NULL) {
        PyErr_Clear();
        return NULL;
    }
    return PyDict_GetItemWithError(type->tp_dict, *key);
}

/* Names of the fields of a NamedTuple class, borrowed; NULL for anything else. */
static PyObject *flight_stack_fields(PyTypeObject *type)
{
    static PyObject *key = NULL;
    PyObject *fields = flight_stack_entry(type, &key, "_fields");
    return fields != NULL && PyTuple_CheckExact(fields) ? fields : NULL;
}

/* Default of a field of a NamedTuple class, borrowed; NULL if it has none. */
static PyObject *flight_stack_default(PyTypeObject *type, PyObject *field)
{
    static PyObject *key = NULL;
    PyObject *defaults = flight_stack_entry(type, &key, "_field_defaults");
    return defaults == NULL ? NULL : PyDict_GetItemWithError(defaults, field);
}

/* A call; if it is of a NamedTuple class with its fields in their order, the last ones perhaps by
default, the tuple is made here. */
static PyObject *flight_stack_call(
    PyObject *callable, PyObject *const *arguments, size_t flags, PyObject *names)
{
    Py_ssize_t placed = PyVectorcall_NARGS(flags);
    Py_ssize_t named = names == NULL ? 0 : PyTuple_GET_SIZE(names), given = placed + named;
    PyTypeObject *type = (PyTypeObject *)callable;
    PyObject *fields = PyType_Check(callable) ? flight_stack_fields(type) : NULL;
    Py_ssize_t all = fields == NULL ? -1 : PyTuple_GET_SIZE(fields);
    int is_whole = given <= all;
    for (Py_ssize_t i = 0; is_whole && i < named; i++) { /* Both are interned */
        is_whole = PyTuple_GET_ITEM(names, i) == PyTuple_GET_ITEM(fields, placed + i);
    }
    for (Py_ssize_t i = given; is_whole && i < all; i++) {
        is_whole = flight_stack_default(type, PyTuple_GET_ITEM(fields, i)) != NULL;
    }
    if (!is_whole) {
        return PyObject_Vectorcall(callable, arguments, flags, names);
    }
    PyObject *made = type->tp_alloc(type, all);
    for (Py_ssize_t i = 0; made != NULL && i < all; i++) {
        PyObject *value = i < given
            ? arguments[i] : flight_stack_default(type, PyTuple_GET_ITEM(fields, i));
        PyTuple_SET_ITEM(made, i, Py_NewRef(value));
    }
    return made;
}

/* Place of a field in a NamedTuple class; -1 if the name is not one of its fields as such. */
static Py_ssize_t flight_stack_place(PyTypeObject *type, PyObject *name)
{
    PyObject *fields = flight_stack_fields(type);
    PyObject *getter = fields == NULL ? NULL : PyDict_GetItemWithError(type->tp_dict, name);
    if (getter == NULL || strcmp(Py_TYPE(getter)->tp_name, "collections._tuplegetter") != 0) {
        return -1;
    }
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(fields); i++) {
        if (PyTuple_GET_ITEM(fields, i) == name) {
            return i;
        }
    }
    return -1;
}

/* An attribute. Each place in the code remembers the class that it last saw, if a NamedTuple. */
#define FLIGHT_STACK_GETATTR(object, name) \
    ({ \
        static PyTypeObject *seen = NULL; \
        static Py_ssize_t place = -1; \
        PyObject *whole = (object), *got; \
        if (Py_TYPE(whole) == seen) { \
            got = Py_NewRef(PyTuple_GET_ITEM(whole, place)); \
        } else { \
            Py_ssize_t found = flight_stack_place(Py_TYPE(whole), (name)); \
            if (found >= 0) { \
                place = found; \
                seen = (PyTypeObject *)Py_NewRef((PyObject *)Py_TYPE(whole)); \
            } \
            got = CPyObject_GetAttr(whole, (name)); \
        } \
        got; \
    })

/* A name of a module. A dictionary has another version tag after every change (PEP 509). */
#if PY_VERSION_HEX < 0x030C0000
#define FLIGHT_STACK_GLOBAL(dict, name) \
    ({ \
        static uint64_t version = 0; \
        static PyObject *value = NULL; \
        PyObject *globals = (dict); \
        if (version == ((PyDictObject *)globals)->ma_version_tag && value != NULL) { \
            Py_INCREF(value); \
        } else { \
            value = CPyDict_GetItem(globals, (name)); \
            version = ((PyDictObject *)globals)->ma_version_tag; \
        } \
        value; \
    })
#else
#define FLIGHT_STACK_GLOBAL(dict, name) CPyDict_GetItem((dict), (name))
#endif

#define PyObject_Vectorcall flight_stack_call
